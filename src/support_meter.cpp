// SPDX-License-Identifier: BSD-2-Clause
#include "support_meter.hpp"

#include <Eigen/Geometry>
#include <limits>

namespace dynacom::internal {

SupportMeter::SupportMeter(const Carrier& carrier, const std::vector<ContactMotion>& contacts,
                           const MotionAnalysis& analysis)
    : contacts_(contacts), analysis_(analysis) {
  for (const FixedContact& fixed : carrier.contacts)
    corners_.push_back(fixed.contact->getCorners());
}

void SupportMeter::addCorners(std::size_t contact, Eigen::Index frame) {
  const Eigen::Quaterniond rotation(Eigen::Vector4d(contacts_[contact].rotation.col(frame)));
  const Eigen::Matrix<double, 3, 2> axes = rotation.toRotationMatrix().leftCols<2>();
  for (Eigen::Index i = 0; i < corners_[contact].cols(); ++i) {
    const Eigen::Vector3d corner =
        contacts_[contact].position.col(frame) + axes * corners_[contact].col(i);
    carrying_.push_back(corner.head<2>());
    height_ += corner.z();
  }
}

double SupportMeter::findDistance(Eigen::Index frame) {
  const double height = height_ / double(carrying_.size());
  const auto force = analysis_.ground_force.col(frame);
  const auto torque = analysis_.ground_torque.col(frame);
  const auto com = analysis_.com.col(frame);
  const Eigen::Vector2d cop =
      com.head<2>() +
      (Eigen::Vector2d(-torque.y(), torque.x()) - force.head<2>() * (com.z() - height)) / force.z();
  const double distance =
      cop.allFinite() ? distanceToHull(cop, carrying_) : std::numeric_limits<double>::infinity();
  return std::isnan(distance) ? std::numeric_limits<double>::infinity() : distance;
}

}  // namespace dynacom::internal
