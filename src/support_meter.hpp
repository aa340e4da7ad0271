// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <vector>

#include "carrier.hpp"
#include "convex_hull.hpp"
#include "dynacom/motion_analysis.hpp"

namespace dynacom::internal {

/// Measures how far the centre of pressure that a motion needs lies outside what carries it; see
/// MotionFault::CoPOutside.
class SupportMeter {
 public:
  /// @param contacts  of the carrier, in its order; must outlive this, as must the analysis
  /// @param analysis  with what the motion needs
  SupportMeter(const Carrier& carrier, const std::vector<ContactMotion>& contacts,
               const MotionAnalysis& analysis);

  /// @param isActive  says of a contact, by its number, whether it carries
  /// @return [m]; infinite where there is no such centre
  template <class Function>
  double measure(Eigen::Index frame, Function isActive) {
    carrying_.clear();
    height_ = 0.;
    for (std::size_t k = 0; k < contacts_.size(); ++k)
      if (isActive(k)) addCorners(k, frame);
    return findDistance(frame);
  }

 private:
  void addCorners(std::size_t contact, Eigen::Index frame);
  double findDistance(Eigen::Index frame);

  const std::vector<ContactMotion>& contacts_;
  const MotionAnalysis& analysis_;
  std::vector<Eigen::Matrix2Xd> corners_;  // of each contact, in its surface
  std::vector<Eigen::Vector2d> carrying_;  // of active contacts in a frame, in the world
  double height_ = 0.;                     // the sum of theirs
};

}  // namespace dynacom::internal
