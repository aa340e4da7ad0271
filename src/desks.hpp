// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <memory>
#include <mutex>
#include <vector>

#include "dynacom/dyna_com.hpp"

namespace dynacom::internal {

/// Where threads work on the motions of a robot: each has a copy of the robot for itself, as long
/// as it needs one, and the next one gets it after that. Copies are expensive: Pinocchio's Data has
/// megabytes.
class Desks {
 public:
  /// @param robot  must outlive this, and not change
  explicit Desks(const DynaCoM& robot) : robot_(robot) {}

  const DynaCoM& robot() const { return robot_; }

  /// A copy whose contacts are placed by the model; what else it has done before is not undone, see
  /// clear(). It must not outlive this.
  std::shared_ptr<DynaCoM> take();

  /// Makes a robot forget what it has done but for its motion: no contact is active, and its next
  /// distribution does not depend on those before.
  static void clear(DynaCoM& robot);

 private:
  const DynaCoM& robot_;
  std::mutex mutex_;                            // of the next two
  std::vector<std::unique_ptr<DynaCoM>> free_;  // with room for all
  std::size_t copies_ = 0;
};

}  // namespace dynacom::internal
