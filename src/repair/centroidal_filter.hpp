// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <vector>

#include "../contact_split.hpp"
#include "../workers.hpp"
#include "dynacom/centroidal_filter.hpp"

namespace dynacom::internal {

/// The same without a robot that knows its parts.
CentroidalChange distanceToFeasible(const ContactSplit& parts,
                                    const std::vector<ContactMotion>& motions,
                                    const MotionAnalysis& dynamics, const ContactSchedule& schedule,
                                    const CentroidalFilterSettings& settings,
                                    const Eigen::Array<bool, Eigen::Dynamic, 1>& free,
                                    Workers& workers);

}  // namespace dynacom::internal
