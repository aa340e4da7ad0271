// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <pinocchio/spatial.hpp>
#include <vector>

#include "../contact_split.hpp"
#include "dynacom/motion_repair.hpp"
#include "whole_body_window.hpp"

namespace dynacom::internal {

/// Where the parts of each contact are, and are to be, while they carry.
class Footwork {
 public:
  /// @param problem, settings, ground  must outlive this; `problem` has all but what place() finds
  Footwork(const ContactSplit& parts, WholeBodyProblem& problem, const RepairSettings& settings,
           const RepairGround& ground);

  /// Finds which parts the problem holds, where, and the floor above which the others are to be.
  std::vector<RepairedStance> place();

 private:
  // A contact, and a bit for each of its parts.
  struct Contact {
    std::size_t index;
    std::uint32_t parts;
    std::vector<pinocchio::SE3> placements;  // of its joint on the ground, which may move, by frame
  };
  using Placements = std::vector<pinocchio::SE3>;

  std::uint32_t setOf(Eigen::Index frame) const {
    return problem_.sets[static_cast<std::size_t>(frame)];
  }
  double stepAt(Eigen::Index frame) const {
    return problem_.time[frame + 1] - problem_.time[frame];
  }
  Eigen::Vector3d moved(Eigen::Index frame) const;
  Eigen::Vector3d locate(std::size_t part, const pinocchio::SE3& placement) const;
  Eigen::Vector3d centre(std::uint32_t parts, const pinocchio::SE3& placement) const;
  double height(std::size_t part, Eigen::Index frame) const;
  RepairedStance stand(const Contact& contact, Eigen::Index first, Eigen::Index behind);
  pinocchio::SE3 average(const Contact& contact, Eigen::Index first, Eigen::Index behind) const;
  pinocchio::SE3 level(const pinocchio::SE3& placement, const std::vector<std::size_t>& parts,
                       const std::vector<double>& ground) const;
  pinocchio::SE3 level(const pinocchio::SE3& placement, std::uint32_t set,
                       Eigen::Index frame) const;
  Placements slowDown(const Contact& contact, Eigen::Index first, Eigen::Index behind) const;
  Placements slowDown(const Placements& path, std::uint32_t parts, Eigen::Index first,
                      double speed_limit) const;
  pinocchio::SE3 follow(const pinocchio::SE3& here, const pinocchio::SE3& slow_here,
                        const pinocchio::SE3& there, std::uint32_t parts, std::uint32_t carrying,
                        double farthest) const;
  void arrive();
  void clear();

  WholeBodyProblem& problem_;
  const RepairSettings& settings_;
  const RepairGround& ground_;
  std::vector<Contact> contacts_;
};

}  // namespace dynacom::internal
