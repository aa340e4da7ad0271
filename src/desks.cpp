// SPDX-License-Identifier: BSD-2-Clause
#include "desks.hpp"

#include <string>
#include <utility>

namespace dynacom::internal {

std::shared_ptr<DynaCoM> Desks::take() {
  std::unique_ptr<DynaCoM> robot;
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    if (!free_.empty()) {
      robot = std::move(free_.back());
      free_.pop_back();
    }
  }
  if (!robot) {
    robot = std::make_unique<DynaCoM>(robot_);
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      free_.reserve(++copies_);  // giving back must not fail
    }
    for (const std::string& name : robot->getKnownContacts()) robot->resetContactPose(name);
  }
  return {robot.release(), [this](DynaCoM* done) {
            std::unique_ptr<DynaCoM> own(done);
            const std::lock_guard<std::mutex> lock(mutex_);
            free_.push_back(std::move(own));
          }};
}

void Desks::clear(DynaCoM& robot) {
  for (const std::string& name : robot.getActiveContacts()) robot.deactivateContact(name);
  robot.forgetAnswers();
}

}  // namespace dynacom::internal
