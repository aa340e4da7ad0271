// SPDX-License-Identifier: BSD-2-Clause
// What all tests use: random numbers, and comparisons that say what differs.
#pragma once

#include <Eigen/Geometry>
#include <boost/test/unit_test.hpp>
#include <cctype>
#include <initializer_list>
#include <ios>
#include <pinocchio/spatial.hpp>
#include <random>
#include <string>

namespace dynacom_tests {

using Eigen::Index;
using Eigen::Matrix3d;
using Eigen::MatrixXd;
using Eigen::Vector2d;
using Eigen::Vector3d;
using Eigen::VectorXd;
using pinocchio::SE3;
using Vector6 = Eigen::Matrix<double, 6, 1>;

/// Random numbers, the same ones in every run.
class Random {
 public:
  explicit Random(unsigned seed) : engine_(seed) {}

  double uniform(double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(engine_);
  }
  /// Between low and high, both included.
  Index integer(Index low, Index high) {
    return std::uniform_int_distribution<Index>(low, high)(engine_);
  }
  bool coin() { return integer(0, 1) == 1; }

  VectorXd vector(Index size, double low, double high) {
    return VectorXd::NullaryExpr(size, [&] { return uniform(low, high); });
  }
  VectorXd vector(Index size, double scale = 1.) { return vector(size, -scale, scale); }
  Vector3d vector3(double scale = 1.) { return vector(3, scale); }

  Matrix3d rotation() {
    std::normal_distribution<double> normal;
    const Eigen::Quaterniond quaternion(normal(engine_), normal(engine_), normal(engine_),
                                        normal(engine_));
    return quaternion.normalized().toRotationMatrix();
  }
  SE3 placement(double scale = 1.) { return SE3(rotation(), vector3(scale)); }

 private:
  std::mt19937 engine_;
};

/// Whether two vectors or matrices have one size, and differ by no more than the tolerance times
/// the largest number expected (or 1, if that is more). NaN is close to nothing.
inline boost::test_tools::predicate_result close(const Eigen::Ref<const MatrixXd>& actual,
                                                 const Eigen::Ref<const MatrixXd>& expected,
                                                 double tolerance = 1e-12) {
  boost::test_tools::predicate_result result(false);
  if (actual.rows() != expected.rows() || actual.cols() != expected.cols()) {
    result.message() << "size is " << actual.rows() << "x" << actual.cols() << " instead of "
                     << expected.rows() << "x" << expected.cols();
    return result;
  }
  if (expected.size() == 0) return true;
  const double scale = std::max(1., expected.cwiseAbs().maxCoeff());
  // Not maxCoeff(), which may overlook a NaN.
  if (((actual - expected).array().abs() <= tolerance * scale).all()) return true;
  result.message() << "\nis\n"
                   << actual << "\ninstead of\n"
                   << expected << "\nthey differ by\n"
                   << actual - expected;
  return result;
}

inline boost::test_tools::predicate_result close(double actual, double expected,
                                                 double tolerance = 1e-12) {
  return close(Eigen::Matrix<double, 1, 1>(actual), Eigen::Matrix<double, 1, 1>(expected),
               tolerance);
}

inline bool allNaN(const Eigen::Ref<const MatrixXd>& matrix) {
  return matrix.array().isNaN().all();
}

/// Whether a text contains a word, or a number, that is not merely a part of another one.
inline bool mentions(const std::string& text, const std::string& word) {
  const auto isPart = [](char c) {
    return std::isalnum(static_cast<unsigned char>(c)) || c == '_';
  };
  for (auto at = text.find(word); at != std::string::npos; at = text.find(word, at + 1)) {
    const auto end = at + word.size();
    const bool begins = at == 0 || !isPart(word.front()) || !isPart(text[at - 1]);
    const bool ends = end == text.size() || !isPart(word.back()) || !isPart(text[end]);
    if (begins && ends) return true;
  }
  return false;
}

/// Whether an action throws an Exception whose message mentions every one of the words.
template <class Exception, class Action>
boost::test_tools::predicate_result throws(Action action,
                                           std::initializer_list<std::string> words) {
  boost::test_tools::predicate_result result(false);
  try {
    action();
    result.message() << "nothing was thrown";
  } catch (const Exception& error) {
    for (const std::string& word : words) {
      if (mentions(error.what(), word)) continue;
      result.message() << "'" << word << "' is missing in the message: " << error.what();
      return result;
    }
    return true;
  } catch (const std::exception& error) {
    result.message() << "another type of exception was thrown: " << error.what();
  }
  return result;
}

}  // namespace dynacom_tests
