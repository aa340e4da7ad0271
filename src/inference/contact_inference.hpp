// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include "../contact_split.hpp"
#include "dynacom/contact_inference.hpp"

namespace dynacom::internal {

/// As its public namesake, without a robot that knows the parts.
ContactInference inferContacts(const ContactSplit& parts, const std::vector<ContactMotion>& motions,
                               const MotionAnalysis& dynamics, bool exact,
                               const DetectionSettings& settings, const ContactSchedule* recorded);

}  // namespace dynacom::internal
