// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <Eigen/Core>
#include <vector>

#include "contact_split.hpp"
#include "dynacom/motion_examination.hpp"

namespace dynacom::internal {

/// What seats are looked for in.
struct SeatQuestion {
  const pinocchio::Model& model;
  pinocchio::Data& data;
  const ContactSplit& parts;
  const std::vector<ContactMotion>& motions;             // of the parts
  const ContactSchedule& schedule;                       // of the parts
  const MotionAnalysis& analysis;                        // with what the motion needs
  const Eigen::Array<bool, Eigen::Dynamic, 1>& missing;  // frames in which they do not suffice
  double highest_ground;                                 // [m]
};

/// Times of half a second and more in which what is missing could be given by one link that is
/// held still, and 0.2 m and more above all ground: of several that could, the lowest.
std::vector<Seat> findSeats(const std::vector<BodyPoints>& bodies, const Motion& motion,
                            const SeatQuestion& question, const ExaminationSettings& settings);

}  // namespace dynacom::internal
