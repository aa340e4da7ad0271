// SPDX-License-Identifier: BSD-2-Clause
#include <algorithm>
#include <charconv>
#include <cmath>

#include "bindings.hpp"

// Reading clips is what most of the time of a batch would go to: numpy.loadtxt takes 170 ns a
// number, pyarrow 50, in threads of its own, and this 30. It knows nothing but numbers, commas and
// ends of lines: all else is for a reader that knows more.

namespace dynacom::python {

namespace {

// The first character behind some lines; null if there are fewer, or if they do not all end as
// those of Unix or of Windows do.
const char* skipLines(const char* at, const char* end, int lines) {
  for (; lines > 0; --lines) {
    const char* const stop = std::find(at, end, '\n');
    if (stop == end) return nullptr;
    const char* const carriage_return = std::find(at, stop, '\r');
    if (carriage_return != stop && carriage_return + 1 != stop) return nullptr;
    at = stop + 1;
  }
  return at;
}

// Reads rows of so many numbers, column by column; false if there is anything else.
bool readRows(const char* at, const char* end, Eigen::MatrixXd& table) {
  for (Eigen::Index row = 0; row < table.rows(); ++row) {
    for (Eigen::Index column = 0; column < table.cols(); ++column) {
      const auto [next, error] = std::from_chars(at, end, table(row, column));
      if (error != std::errc() || !std::isfinite(table(row, column))) return false;
      at = next;
      if (column + 1 < table.cols() && (at == end || *at++ != ',')) return false;
    }
    if (at != end && *at == '\r') ++at;
    if (at != end ? *at++ != '\n' : row + 1 < table.rows()) return false;
  }
  return at == end;
}

bp::object readNumberTable(const bp::object& content, int lines, int columns) {
  char* begin = nullptr;
  Py_ssize_t size = 0;
  if (PyBytes_AsStringAndSize(content.ptr(), &begin, &size) != 0) bp::throw_error_already_set();
  const char* const end = begin + size;
  Eigen::MatrixXd table;
  bool is_read = false;
  {
    const WithoutLock without_lock;
    const char* const first = skipLines(begin, end, lines);
    if (first && first != end) {
      const Eigen::Index ends = std::count(first, end, '\n');
      table.resize(ends + (end[-1] == '\n' ? 0 : 1), columns);
      is_read = readRows(first, end, table);
    }
  }
  return is_read ? toArray(table) : bp::object();
}

}  // namespace

void exposeNumberTable() {
  bp::def("_readNumberTable", &readNumberTable,
          (bp::arg("content"), bp::arg("lines"), bp::arg("columns")),
          "The numbers (T, columns) in the bytes of a file, below so many lines: each row must\n"
          "have as many finite numbers, with commas between them and nothing else. None if there\n"
          "is something else, or nothing.");
}

}  // namespace dynacom::python
