// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <Eigen/Core>
#include <vector>

namespace dynacom::internal {

/// A matrix or vector that keeps the storage of the largest that it has been, so that it can become
/// smaller and larger again without allocating, as Eigen's own cannot. What is assigned gives it
/// its size; resizing loses what it held, so that it must not be assigned an expression of itself.
template <class Plain>
class Kept : public Eigen::Map<Plain> {
 public:
  using Base = Eigen::Map<Plain>;
  using Scalar = typename Base::Scalar;
  using Base::setConstant;
  using Base::setZero;

  Kept()
      : Base(nullptr, initialSize(Plain::RowsAtCompileTime),
             initialSize(Plain::ColsAtCompileTime)) {}
  Kept(const Kept& other) : Kept() { *this = other; }
  Kept& operator=(const Kept& other) { return *this = static_cast<const Base&>(other); }
  template <class Derived>
  Kept& operator=(const Eigen::DenseBase<Derived>& other) {
    resize(other.rows(), other.cols());
    Base::operator=(other.derived());
    return *this;
  }

  void resize(Eigen::Index rows, Eigen::Index cols) {
    if (rows * cols > storage_.size()) storage_.resize(rows * cols);
    new (static_cast<Base*>(this)) Base(storage_.data(), rows, cols);  // as Eigen wants it
  }
  void resize(Eigen::Index size) { resize(size, 1); }
  void setZero(Eigen::Index rows, Eigen::Index cols) {
    resize(rows, cols);
    Base::setZero();
  }
  void setZero(Eigen::Index size) { setZero(size, 1); }
  void setConstant(Eigen::Index size, const Scalar& value) {
    resize(size);
    Base::setConstant(value);
  }

 private:
  static Eigen::Index initialSize(int at_compile_time) {
    return at_compile_time == Eigen::Dynamic ? 0 : at_compile_time;
  }

  Eigen::Array<Scalar, Eigen::Dynamic, 1> storage_;
};

/// A list that keeps its elements, with their storage, when it becomes shorter.
template <class Element>
class KeptList {
 public:
  void resize(std::size_t size) {
    if (size > elements_.size()) elements_.resize(size);
    size_ = size;
  }
  std::size_t size() const { return size_; }
  Element& operator[](std::size_t k) { return elements_[k]; }
  const Element* begin() const { return elements_.data(); }
  const Element* end() const { return elements_.data() + size_; }

 private:
  std::vector<Element> elements_;
  std::size_t size_ = 0;
};

}  // namespace dynacom::internal
