// SPDX-License-Identifier: BSD-2-Clause
#include "seat_search.hpp"

#include <algorithm>
#include <cmath>
#include <pinocchio/algorithm/kinematics.hpp>

#include "dynacom/contact_point.hpp"
#include "inference/cone_projection.hpp"
#include "repair/part_sets.hpp"

namespace dynacom::internal {

using Eigen::Index;

namespace {

// A seat is needed for so long, but for interruptions of less than this [s].
constexpr double kLeastTime = 0.5, kInterruption = 0.2;
// So many frames are looked at, evenly spread, of which so many must do.
constexpr Index kSamples = 20;
constexpr double kSuffices = 0.8;
// A link is held still if no point of it that matters is farther than this from its mean [m].
constexpr double kStill = 0.03;
// How far above all ground a seat is [m].
constexpr double kAboveGround = 0.2;
// What of a link may touch a seat is no higher than this above its lowest point [m].
constexpr double kThickness = 0.05;
// Less than this is no reason to ask for a seat [m g].
constexpr double kLeastShare = 0.3;

struct Run {
  Index first, behind;
};

std::vector<Run> findRuns(const Eigen::Array<bool, Eigen::Dynamic, 1>& missing,
                          const Eigen::VectorXd& time) {
  std::vector<Run> runs;
  for (Index frame = 0; frame < time.size(); ++frame) {
    if (!missing[frame]) continue;
    if (!runs.empty() &&
        (frame == runs.back().behind || time[frame] - time[runs.back().behind - 1] < kInterruption))
      runs.back().behind = frame + 1;
    else
      runs.push_back({frame, frame + 1});
  }
  runs.erase(std::remove_if(runs.begin(), runs.end(),
                            [&](const Run& run) {
                              return time[run.behind - 1] - time[run.first] < kLeastTime;
                            }),
             runs.end());
  return runs;
}

// Where all joints are in each of some frames.
std::vector<std::vector<pinocchio::SE3>> placeJoints(const SeatQuestion& question,
                                                     const Motion& motion,
                                                     const std::vector<Index>& frames) {
  std::vector<std::vector<pinocchio::SE3>> joints;
  for (const Index frame : frames) {
    pinocchio::forwardKinematics(question.model, question.data, motion.q.col(frame));
    joints.emplace_back(question.data.oMi.begin(), question.data.oMi.end());
  }
  return joints;
}

// Where a link's points are in each of some frames, at their lowest.
std::vector<Eigen::Matrix3Xd> placePoints(const std::vector<std::vector<pinocchio::SE3>>& joints,
                                          const BodyPoints& body) {
  std::vector<Eigen::Matrix3Xd> places;
  for (const std::vector<pinocchio::SE3>& placed : joints) {
    const pinocchio::SE3& joint = placed[body.joint];
    Eigen::Matrix3Xd points = joint.rotation() * body.points;
    points.colwise() += joint.translation();
    points.row(2) -= body.radius.transpose();
    places.push_back(std::move(points));
  }
  return places;
}

}  // namespace

std::vector<Seat> findSeats(const std::vector<BodyPoints>& bodies, const Motion& motion,
                            const SeatQuestion& question, const ExaminationSettings& settings) {
  const std::vector<Run> runs = findRuns(question.missing, motion.time);
  std::vector<Seat> seats;
  if (runs.empty()) return seats;
  const double weight = -question.parts.carrier.mass * question.parts.carrier.gravity.z();
  if (!(weight > 0.)) return seats;
  const std::vector<FixedContact>& points = question.parts.carrier.contacts;
  const std::vector<Section> of_parts = listFriction(question.parts);
  SurfaceOptions of_link;
  of_link.friction = settings.friction;
  const Section of_links = of_link.makeFriction(findBodyFriction(points));

  for (const Run& run : runs) {
    std::vector<Index> frames;
    for (Index k = 0; k < kSamples; ++k) {
      const Index frame = run.first + k * (run.behind - 1 - run.first) / (kSamples - 1);
      if (frames.empty() || frames.back() != frame) frames.push_back(frame);
    }
    const auto joints = placeJoints(question, motion, frames);
    Seat best = {"", run.first, run.behind, 0., 0.};
    for (const BodyPoints& body : bodies) {
      if (body.points.cols() == 0) continue;
      const auto places = placePoints(joints, body);
      Eigen::Matrix3Xd mean = Eigen::Matrix3Xd::Zero(3, body.points.cols());
      for (const Eigen::Matrix3Xd& points : places) mean += points / double(places.size());
      const double height = mean.row(2).minCoeff();
      if (height < question.highest_ground + kAboveGround) continue;
      if (!best.link.empty() && height >= best.height) continue;
      std::vector<Index> low;
      bool is_still = true;
      for (Index point = 0; point < mean.cols(); ++point) {
        if (mean(2, point) > height + kThickness) continue;
        low.push_back(point);
        for (const Eigen::Matrix3Xd& points : places)
          is_still = is_still && (points.col(point) - mean.col(point)).norm() <= kStill;
      }
      if (!is_still) continue;

      int looked_at = 0, suffices = 0;
      double share = 0.;
      ConeProjection projection(settings.detection.lever);
      for (std::size_t sample = 0; sample < frames.size(); ++sample) {
        const Index frame = frames[sample];
        if (!question.missing[frame]) continue;
        ++looked_at;
        std::vector<Eigen::Vector3d> levers;
        std::vector<Section> friction;
        const Eigen::Vector3d com = question.analysis.com.col(frame);
        for (std::size_t k = 0; k < of_parts.size(); ++k) {
          if (!question.schedule.active(Index(k), frame)) continue;
          levers.push_back(question.motions[k].position.col(frame) - com);
          friction.push_back(of_parts[k]);
        }
        std::uint32_t seat = 0;
        for (const Index point : low) {
          if (levers.size() == ConeProjection::kMaximalPoints) break;
          seat |= std::uint32_t(1) << levers.size();
          levers.push_back(places[sample].col(point) - com);
          friction.push_back(of_links);
        }
        Eigen::Matrix3Xd all(3, Index(levers.size()));
        for (std::size_t k = 0; k < levers.size(); ++k) all.col(Index(k)) = levers[k];
        ConeProjection::Vector6 wrench;
        wrench << question.analysis.ground_force.col(frame),
            question.analysis.ground_torque.col(frame);
        const auto set = static_cast<std::uint32_t>((std::uint64_t(1) << levers.size()) - 1);
        const auto left = projection.project(wrench, all, friction, set);
        if (left.force <= settings.verdict.residual_force.limit * weight &&
            left.torque <= settings.verdict.residual_torque.limit * weight) {
          ++suffices;
          share += projection.lift(seat) / weight;
        }
      }
      if (looked_at == 0 || suffices < kSuffices * looked_at) continue;
      share /= suffices;
      if (share < kLeastShare) continue;
      best.link = body.link;
      best.height = height;
      best.weight_share = share;
    }
    if (!best.link.empty()) seats.push_back(best);
  }
  return seats;
}

}  // namespace dynacom::internal
