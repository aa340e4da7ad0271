// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <vector>

#include "desks.hpp"
#include "dynacom/motion_verdict.hpp"
#include "workers.hpp"

// The steps of an examination, by threads that are there already. Their public namesakes bring
// threads of their own.

namespace dynacom::internal {

std::vector<ContactMotion> computeContactMotions(Desks& desks, const Motion& motion,
                                                 Workers& workers);

/// @param ground_height  in place of the robot's [m]
/// @param settings       of which threads and lanes are not looked at
MotionAnalysis analyzeMotion(Desks& desks, double ground_height, const Motion& motion,
                             const ContactSchedule& schedule, const AnalysisSettings& settings,
                             Workers& workers);

MotionVerdict judgeMotion(const DynaCoM& robot, const Motion& motion,
                          const RecordedMotion& recorded,
                          const std::vector<ContactMotion>& contacts, const Eigen::MatrixXd& ground,
                          const MotionAnalysis& analysis,
                          const Eigen::Array<bool, Eigen::Dynamic, 1>& unsure,
                          const VerdictSettings& settings, Workers& workers);

/// Judges where normals point in a verdict of judgeMotion() that was made for other contacts: sets
/// MotionVerdict::normals and what follows from DownwardNormal.
/// @param contacts, analyzed  of the same contacts, in the same order
void judgeNormals(const std::vector<ContactMotion>& contacts,
                  const std::vector<MotionAnalysis::Contact>& analyzed, const Eigen::VectorXd& time,
                  const VerdictSettings& settings, MotionVerdict& verdict);

}  // namespace dynacom::internal
