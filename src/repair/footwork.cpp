// SPDX-License-Identifier: BSD-2-Clause
#include "footwork.hpp"

#include <Eigen/Geometry>
#include <Eigen/QR>
#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <pinocchio/algorithm/kinematics.hpp>

#include "../nan.hpp"

namespace dynacom::internal {

using Eigen::Index;
using pinocchio::SE3;

namespace {

// By how much faster contacts may slide where they would have to be displaced too far.
constexpr double kFaster = 1.8;

template <class Function>
void forEachPart(std::uint32_t set, Function act) {
  for (; set != 0; set &= set - 1) act(static_cast<std::size_t>(__builtin_ctz(set)));
}

// Of a rotation, about the vertical.
double findYaw(const Eigen::Matrix3d& rotation) { return pinocchio::log3(rotation).z(); }

}  // namespace

Footwork::Footwork(const ContactSplit& parts, WholeBodyProblem& problem,
                   const RepairSettings& settings, const RepairGround& ground)
    : problem_(problem), settings_(settings), ground_(ground) {
  for (std::size_t part = 0; part < parts.parts.size(); ++part) {
    const std::size_t contact = parts.parts[part].contact;
    if (contacts_.empty() || contacts_.back().index != contact)
      contacts_.push_back({contact, 0, {}});
    contacts_.back().parts |= std::uint32_t(1) << part;
  }
  pinocchio::Data data(problem.model);
  const Index frames = problem.time.size();
  problem.targets.assign(problem.points.size(), Eigen::Matrix3Xd(3, frames));
  problem.held = problem.sets;
  for (Index frame = 0; frame < frames; ++frame) {
    pinocchio::forwardKinematics(problem.model, data, problem.q.col(frame));
    for (std::size_t k = 0; k < problem.points.size(); ++k)
      problem.targets[k].col(frame) = locate(k, data.oMi[problem.points[k].joint]);
    for (Contact& contact : contacts_) {
      const auto first = static_cast<std::size_t>(__builtin_ctz(contact.parts));
      contact.placements.push_back(data.oMi[problem.points[first].joint]);
      contact.placements.back().translation() -= moved(frame);
    }
  }
}

std::vector<RepairedStance> Footwork::place() {
  std::vector<RepairedStance> stances;
  const Index frames = problem_.time.size();
  for (const Contact& contact : contacts_)
    for (Index first = 0, behind = 0; first < frames; first = behind) {
      behind = first + 1;
      if ((setOf(first) & contact.parts) == 0) continue;
      while (behind < frames && (setOf(behind) & contact.parts) != 0) ++behind;
      stances.push_back(stand(contact, first, behind));
    }
  if (settings_.feet) arrive();
  if (settings_.feet && ground_.height.rows() > 0) clear();
  return stances;
}

// Parts are where they carry one frame before, and after, too: who lands or leaves does so at rest.
void Footwork::arrive() {
  const Index frames = problem_.time.size();
  for (Index frame = 0; frame < frames; ++frame)
    for (std::size_t part = 0; part < problem_.points.size(); ++part) {
      const auto carriesAt = [&](Index k) {
        return k >= 0 && k < frames && (setOf(k) >> part & 1u);
      };
      if (carriesAt(frame) || carriesAt(frame - 1) == carriesAt(frame + 1)) continue;
      const Index there = carriesAt(frame - 1) ? frame - 1 : frame + 1;
      problem_.held[static_cast<std::size_t>(frame)] |= std::uint32_t(1) << part;
      problem_.targets[part].col(frame) =
          problem_.targets[part].col(there) + moved(frame) - moved(there);
    }
}

// Parts in the air keep above the ground under them, and those of a contact none of whose parts
// carries as far as it can get from one stance to the next.
void Footwork::clear() {
  constexpr double kAcceleration = 10.;  // [m/s²]
  const Index frames = problem_.time.size();
  problem_.floor = ground_.height;
  for (const Contact& contact : contacts_) {
    Eigen::VectorXd away =
        Eigen::VectorXd::Constant(frames, std::numeric_limits<double>::infinity());
    const auto measureFrom = [&](Index from, Index to) {
      away[to] =
          (setOf(to) & contact.parts) != 0
              ? 0.
              : std::min(away[to], away[from] + std::abs(problem_.time[to] - problem_.time[from]));
    };
    measureFrom(0, 0);
    for (Index frame = 1; frame < frames; ++frame) measureFrom(frame - 1, frame);
    for (Index frame = frames - 1; frame > 0; --frame) measureFrom(frame, frame - 1);
    forEachPart(contact.parts, [&](std::size_t part) {
      problem_.floor.row(Index(part)).array() +=
          (0.5 * kAcceleration * away.array().square()).min(settings_.clearance).transpose();
    });
  }
}

// By how much the ground has.
Eigen::Vector3d Footwork::moved(Index frame) const {
  return (problem_.time[frame] - problem_.time[0]) * ground_.velocity;
}

Eigen::Vector3d Footwork::locate(std::size_t part, const SE3& placement) const {
  Eigen::Vector3d place = placement.act(problem_.points[part].place);
  place.z() -= problem_.points[part].drop;
  return place;
}

// Where parts are on average with a placement.
Eigen::Vector3d Footwork::centre(std::uint32_t parts, const SE3& placement) const {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  forEachPart(parts, [&](std::size_t part) { sum += locate(part, placement); });
  return sum / double(__builtin_popcount(parts));
}

// Of the ground under a part, NaN where that is not known.
double Footwork::height(std::size_t part, Index frame) const {
  return settings_.feet && ground_.height.rows() > 0 ? ground_.height(Index(part), frame) : kNaN;
}

RepairedStance Footwork::stand(const Contact& contact, Index first, Index behind) {
  const SE3 mean = average(contact, first, behind);
  RepairedStance stance = {contact.index, first, behind, 0., false};
  std::map<std::size_t, std::pair<double, int>> heights;  // sums, and of how many
  for (Index frame = first; frame < behind; ++frame)
    forEachPart(setOf(frame) & contact.parts, [&](std::size_t part) {
      const Eigen::Vector3d place = locate(part, mean) + moved(frame);
      stance.drift = std::max(stance.drift, (problem_.targets[part].col(frame) - place).norm());
      const double under = height(part, frame);
      if (std::isnan(under)) return;
      heights[part].first += under;
      ++heights[part].second;
    });
  if (!settings_.feet) return stance;
  stance.is_still = stance.drift <= settings_.largest_drift;
  Placements slow;
  if (stance.is_still) {
    std::vector<std::size_t> known;
    std::vector<double> ground;
    for (const auto& [part, sum] : heights) {
      known.push_back(part);
      ground.push_back(sum.first / sum.second);
    }
    slow.assign(std::size_t(behind - first), level(mean, known, ground));
  } else {
    slow = slowDown(contact, first, behind);
    for (Index frame = first; frame < behind; ++frame) {
      SE3& placement = slow[std::size_t(frame - first)];
      placement = level(placement, setOf(frame) & contact.parts, frame);
    }
  }
  for (Index frame = first; frame < behind; ++frame)
    forEachPart(setOf(frame) & contact.parts, [&](std::size_t part) {
      problem_.targets[part].col(frame) =
          locate(part, slow[std::size_t(frame - first)]) + moved(frame);
    });
  return stance;
}

// The mean of a contact's placements, without those in which fewer parts carry than in others: the
// mean rotation, and the parts that carry where they are on average.
SE3 Footwork::average(const Contact& contact, Index first, Index behind) const {
  int most = 0;
  for (Index frame = first; frame < behind; ++frame)
    most = std::max(most, __builtin_popcount(setOf(frame) & contact.parts));
  const auto forEach = [&](const auto& act) {
    for (Index frame = first; frame < behind; ++frame)
      if (const std::uint32_t set = setOf(frame) & contact.parts; __builtin_popcount(set) == most)
        act(contact.placements[std::size_t(frame)], set);
  };
  Eigen::Vector4d sum = Eigen::Vector4d::Zero();
  forEach([&](const SE3& placement, std::uint32_t) {
    const Eigen::Vector4d own = Eigen::Quaterniond(placement.rotation()).coeffs();
    sum += own.dot(sum) < 0. ? Eigen::Vector4d(-own) : own;
  });
  const SE3 turned(Eigen::Quaterniond(Eigen::Vector4d(sum.normalized())), Eigen::Vector3d::Zero());
  Eigen::Vector3d place = Eigen::Vector3d::Zero();
  double count = 0.;
  forEach([&](const SE3& placement, std::uint32_t set) {
    place += centre(set, placement) - centre(set, turned);
    ++count;
  });
  return {turned.rotation(), place / count};
}

// Turns and lifts a placement of a contact such that parts of it are as close to the ground under
// them as can be.
SE3 Footwork::level(const SE3& placement, const std::vector<std::size_t>& parts,
                    const std::vector<double>& ground) const {
  constexpr int kIterations = 3;
  const auto count = Index(parts.size());
  SE3 levelled = placement;
  for (int k = 0; k < kIterations && count > 0; ++k) {
    Eigen::Matrix3Xd places(3, count);
    for (Index row = 0; row < count; ++row)
      places.col(row) = locate(parts[std::size_t(row)], levelled);
    const Eigen::Vector3d centre = places.rowwise().mean();
    // Heights depend on the lift, and on turns about x and y through the centre.
    Eigen::MatrixX3d of_heights(count, 3);
    of_heights << Eigen::VectorXd::Ones(count), (places.row(1).array() - centre.y()).transpose(),
        (centre.x() - places.row(0).array()).transpose();
    const Eigen::VectorXd off =
        Eigen::Map<const Eigen::VectorXd>(ground.data(), count) - places.row(2).transpose();
    const Eigen::Vector3d solution =
        Eigen::CompleteOrthogonalDecomposition<Eigen::MatrixX3d>(of_heights).solve(off);
    const Eigen::Matrix3d turn = pinocchio::exp3(Eigen::Vector3d(solution[1], solution[2], 0.));
    levelled = {turn * levelled.rotation(), centre + turn * (levelled.translation() - centre) +
                                                solution[0] * Eigen::Vector3d::UnitZ()};
  }
  return levelled;
}

// The same of the parts of a set, with the ground of a frame, as far as that is known.
SE3 Footwork::level(const SE3& placement, std::uint32_t set, Index frame) const {
  std::vector<std::size_t> known;
  std::vector<double> ground;
  forEachPart(set, [&](std::size_t part) {
    const double under = height(part, frame);
    if (std::isnan(under)) return;
    known.push_back(part);
    ground.push_back(under);
  });
  return level(placement, known, ground);
}

// Placements of a contact in a stance in which no part slides faster than it may. Where that would
// lead too far from where it was, it may be faster; who slides in earnest goes on as it did.
Footwork::Placements Footwork::slowDown(const Contact& contact, Index first, Index behind) const {
  const auto begin = contact.placements.begin();
  const Placements path(begin + first, begin + behind);
  for (const double factor : {1., kFaster}) {
    Placements slow = slowDown(path, contact.parts, first, factor * settings_.slide_speed);
    double farthest = 0.;
    for (std::size_t k = 0; k < path.size(); ++k) {
      const std::uint32_t set = setOf(first + Index(k)) & contact.parts;
      farthest = std::max(farthest, (centre(set, slow[k]) - centre(set, path[k])).norm());
    }
    if (farthest <= settings_.largest_shift) return slow;
  }
  return path;
}

// It stays where it is slowest, and goes on from there both ways, back to where it was as fast as
// it may.
Footwork::Placements Footwork::slowDown(const Placements& path, std::uint32_t parts, Index first,
                                        double speed_limit) const {
  const auto count = Index(path.size());
  const auto bothOf = [&](Index k) { return setOf(first + k) & setOf(first + k + 1) & parts; };
  Index slowest = 0;
  double least = std::numeric_limits<double>::infinity();
  for (Index k = 0; k + 1 < count; ++k) {
    if (bothOf(k) == 0) continue;
    const Eigen::Vector3d slide =
        centre(bothOf(k), path[std::size_t(k + 1)]) - centre(bothOf(k), path[std::size_t(k)]);
    const double speed = slide.norm() / stepAt(first + k);
    if (speed >= least) continue;
    least = speed;
    slowest = k;
  }
  Placements slow = path;
  const auto step = [&](Index from, Index to) {
    const Index earlier = std::min(from, to);
    slow[std::size_t(to)] =
        follow(path[std::size_t(from)], slow[std::size_t(from)], path[std::size_t(to)], parts,
               bothOf(earlier), speed_limit * stepAt(first + earlier));
  };
  for (Index k = slowest; k + 1 < count; ++k) step(k, k + 1);
  for (Index k = slowest; k > 0; --k) step(k, k - 1);
  return slow;
}

// What follows a placement `there` that was `here`, if what carries slides no faster than it may:
// half of that with its centre, and half around it.
SE3 Footwork::follow(const SE3& here, const SE3& slow_here, const SE3& there, std::uint32_t parts,
                     std::uint32_t carrying, double farthest) const {
  if (carrying == 0) return there;
  const auto limit = [](double value, double largest) {
    return std::clamp(value, -largest, largest);
  };
  const Eigen::Vector3d middle = centre(carrying, there), slow_middle = centre(carrying, slow_here);
  double lever = 0.;
  forEachPart(parts, [&](std::size_t part) {
    lever = std::max(lever, (locate(part, there) - middle).norm());
  });
  const double largest = 0.5 * farthest;
  // By how much the slow one is turned more than the other.
  const double extra = findYaw(slow_here.rotation() * here.rotation().transpose());
  const double yaw = findYaw(there.rotation() * here.rotation().transpose());
  const double other_extra =
      extra - yaw + (lever > 0. ? limit(yaw - extra, largest / lever) : yaw - extra);
  Eigen::Vector3d slide = middle - slow_middle;
  const double size = slide.head<2>().norm();
  if (size > largest) slide.head<2>() *= largest / size;
  const Eigen::Matrix3d turn =
      Eigen::AngleAxisd(other_extra, Eigen::Vector3d::UnitZ()).toRotationMatrix();
  return {turn * there.rotation(), slow_middle + slide + turn * (there.translation() - middle)};
}

}  // namespace dynacom::internal
