// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <algorithm>
#include <cstddef>
#include <experimental/simd>
#include <limits>
#include <vector>

// Numbers of several frames at once, one in each lane of a SIMD register, and how they are read and
// written. Only for sources that are compiled once for each width of registers: no other header may
// include it.

namespace dynacom::lanes {

namespace stdx = std::experimental;

// A number of each frame, and whether something is so in each.
using Lanes = stdx::native_simd<double>;
using Mask = Lanes::mask_type;
constexpr int kLanes = static_cast<int>(Lanes::size());

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

// Vectors and matrices in three dimensions, the latter by their columns.
struct Vector {
  Lanes x, y, z;
};
struct Matrix {
  Vector x, y, z;
};

inline Vector operator+(const Vector& a, const Vector& b) {
  return {a.x + b.x, a.y + b.y, a.z + b.z};
}
inline Vector operator-(const Vector& a, const Vector& b) {
  return {a.x - b.x, a.y - b.y, a.z - b.z};
}
inline Vector operator*(const Lanes& s, const Vector& a) { return {s * a.x, s * a.y, s * a.z}; }
inline Vector& operator+=(Vector& a, const Vector& b) { return a = a + b; }
inline Lanes dot(const Vector& a, const Vector& b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
inline Vector cross(const Vector& a, const Vector& b) {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
inline Vector operator*(const Matrix& m, const Vector& a) {
  return a.x * m.x + a.y * m.y + a.z * m.z;
}
inline Matrix operator*(const Matrix& m, const Matrix& n) { return {m * n.x, m * n.y, m * n.z}; }
inline Vector transposed(const Matrix& m, const Vector& a) {
  return {dot(m.x, a), dot(m.y, a), dot(m.z, a)};
}
inline Vector broadcast(const double* a) { return {a[0], a[1], a[2]}; }
inline Matrix broadcastMatrix(const double* m) {
  return {broadcast(m), broadcast(m + 3), broadcast(m + 6)};
}
inline Vector zero() { return {0., 0., 0.}; }
inline Matrix identity() { return {{1., 0., 0.}, {0., 1., 0.}, {0., 0., 1.}}; }

// As Eigen has it.
inline Matrix rotationOf(const Lanes& x, const Lanes& y, const Lanes& z, const Lanes& w) {
  const Lanes tx = 2. * x, ty = 2. * y, tz = 2. * z;
  const Lanes xx = tx * x, xy = tx * y, xz = tx * z, yy = ty * y, yz = ty * z, zz = tz * z;
  const Lanes wx = tx * w, wy = ty * w, wz = tz * w;
  return {{1. - (yy + zz), xy + wz, xz - wy},
          {xy - wz, 1. - (xx + zz), yz + wx},
          {xz + wy, yz - wx, 1. - (xx + yy)}};
}

// The quaternion (x, y, z, w), as Eigen has it: by its largest component, or by w where the trace
// is positive.
inline void findQuaternion(const Matrix& m, Lanes (&quaternion)[4]) {
  const Lanes xx = m.x.x, yy = m.y.y, zz = m.z.z;
  const Lanes trace = xx + yy + zz;
  // Four times the product of each component with the one that is chosen.
  Lanes square = 1. + trace;
  Lanes x = m.y.z - m.z.y, y = m.z.x - m.x.z, z = m.x.y - m.y.x, w = square;
  const auto choose = [&](const Mask& mask, const Lanes& chosen, const Lanes& with_x,
                          const Lanes& with_y, const Lanes& with_z, const Lanes& with_w) {
    stdx::where(mask, square) = chosen;
    stdx::where(mask, x) = with_x;
    stdx::where(mask, y) = with_y;
    stdx::where(mask, z) = with_z;
    stdx::where(mask, w) = with_w;
  };
  const Lanes xy = m.x.y + m.y.x, xz = m.x.z + m.z.x, yz = m.y.z + m.z.y;
  const Lanes from_x = x, from_y = y, from_z = z;
  const Mask other = !(trace > 0.);
  const Mask by_y = other && yy > xx && yy >= zz, by_z = other && zz > xx && zz > yy;
  const Mask by_x = other && !by_y && !by_z;
  const Lanes square_x = 1. + xx - yy - zz, square_y = 1. + yy - zz - xx,
              square_z = 1. + zz - xx - yy;
  choose(by_x, square_x, square_x, xy, xz, from_x);
  choose(by_y, square_y, xy, square_y, yz, from_y);
  choose(by_z, square_z, xz, yz, square_z, from_z);
  const Lanes scale = 0.5 / stdx::sqrt(square);
  quaternion[0] = scale * x;
  quaternion[1] = scale * y;
  quaternion[2] = scale * z;
  quaternion[3] = scale * w;
}

// L D Lᵀ of a symmetric 6 × 6 matrix, in place: L below the diagonal, 1/D on it.
struct Factors {
  Lanes m[6][6];
  Lanes least_pivot, largest_pivot;

  void compute() {
    for (int j = 0; j < 6; ++j) {
      const Lanes pivot = m[j][j];
      least_pivot = j == 0 ? pivot : stdx::min(least_pivot, pivot);
      largest_pivot = j == 0 ? pivot : stdx::max(largest_pivot, pivot);
      const Lanes inverse = 1. / pivot;
      m[j][j] = inverse;
      Lanes column[6];
      for (int i = j + 1; i < 6; ++i) {
        column[i] = m[i][j];
        m[i][j] *= inverse;
      }
      for (int i = j + 1; i < 6; ++i)
        for (int k = j + 1; k <= i; ++k) m[i][k] -= m[i][j] * column[k];
    }
  }

  void solve(Lanes* x) const {
    for (int j = 0; j < 6; ++j)
      for (int i = j + 1; i < 6; ++i) x[i] -= m[i][j] * x[j];
    for (int j = 0; j < 6; ++j) x[j] *= m[j][j];
    for (int j = 5; j > 0; --j)
      for (int i = 0; i < j; ++i) x[i] -= m[j][i] * x[j];
  }
};

// The frames at hand: as many as there are lanes, or those that are left.
class Block {
 protected:
  // Takes frames from the first on, of so many altogether.
  void take(std::ptrdiff_t first, std::ptrdiff_t frames) {
    count_ = static_cast<int>(std::min<std::ptrdiff_t>(kLanes, frames - first));
    for (int lane = 0; lane < kLanes; ++lane) frames_[lane] = first + std::min(lane, count_ - 1);
  }
  // The same of a list.
  void take(const std::vector<std::ptrdiff_t>& list, std::ptrdiff_t first) {
    take(first, static_cast<std::ptrdiff_t>(list.size()));
    for (std::ptrdiff_t& frame : frames_) frame = list[static_cast<std::size_t>(frame)];
  }
  // Lanes that are too many do what the last one does.
  std::ptrdiff_t frameOf(int lane) const { return frames_[lane]; }

  // Reads columns.
  template <int kRows>
  void load(const double* columns, Lanes (&values)[kRows]) const {
    for (int row = 0; row < kRows; ++row)
      values[row] = Lanes([&](auto lane) { return columns[frameOf(lane) * kRows + row]; });
  }
  Vector loadVector(const double* columns) const {
    Lanes values[3];
    load(columns, values);
    return {values[0], values[1], values[2]};
  }

  template <int kRows>
  void store(double* columns, const Lanes (&values)[kRows]) const {
    storeWhere(Mask(true), columns, values);
  }
  void store(double* columns, const Vector& values) const {
    store(columns, {values.x, values.y, values.z});
  }
  // The same, where something is so.
  template <int kRows>
  void storeWhere(const Mask& mask, double* columns, const Lanes (&values)[kRows]) const {
    double buffer[kRows][kLanes];
    for (int row = 0; row < kRows; ++row) values[row].copy_to(buffer[row], stdx::element_aligned);
    for (int lane = 0; lane < count_; ++lane) {
      if (!mask[lane]) continue;
      double* column = columns + frameOf(lane) * kRows;
      for (int row = 0; row < kRows; ++row) column[row] = buffer[row][lane];
    }
  }
  void storeWhere(const Mask& mask, double* columns, const Vector& values) const {
    storeWhere(mask, columns, {values.x, values.y, values.z});
  }

  void store(bool* values, const Mask& mask) const {
    for (int lane = 0; lane < count_; ++lane) values[frameOf(lane)] = mask[lane];
  }

  int count_ = 0;

 private:
  std::ptrdiff_t frames_[kLanes] = {};
};

}  // namespace dynacom::lanes
