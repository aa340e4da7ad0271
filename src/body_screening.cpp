// SPDX-License-Identifier: BSD-2-Clause
#include "body_screening.hpp"

#include <algorithm>
#include <limits>
#include <pinocchio/algorithm/kinematics.hpp>

namespace dynacom::internal {

using Eigen::Index;

namespace {

// A point this close to one that was chosen is worth the less, the closer it is [m].
constexpr double kApart = 0.15;

struct Candidate {
  std::size_t body;
  Index point;
  double score;           // how deep within reach it was, summed over frames
  Eigen::Vector3d place;  // mean of where it was then, in the root's axes
  double distance;        // to the closest one that was chosen
  bool is_chosen;
};

}  // namespace

std::vector<BodyPoints> screenBodies(const pinocchio::Model& model,
                                     const std::vector<BodyPoints>& bodies, const Motion& motion,
                                     const Eigen::Array<bool, Eigen::Dynamic, 1>& missing,
                                     std::vector<double> levels, double reach, std::size_t most) {
  std::sort(levels.begin(), levels.end());
  pinocchio::Data data(model);
  std::vector<Eigen::VectorXd> scores, heights;
  std::vector<Eigen::Matrix3Xd> places;
  for (const BodyPoints& body : bodies) {
    scores.push_back(Eigen::VectorXd::Zero(body.points.cols()));
    places.push_back(Eigen::Matrix3Xd::Zero(3, body.points.cols()));
  }
  heights = scores;
  for (Index frame = 0; frame < motion.frames(); ++frame) {
    if (!missing[frame]) continue;
    pinocchio::forwardKinematics(model, data, motion.q.col(frame));
    double lowest = levels.empty() ? std::numeric_limits<double>::infinity() : levels.front();
    for (std::size_t k = 0; k < bodies.size(); ++k) {
      const pinocchio::SE3& joint = data.oMi[bodies[k].joint];
      heights[k] = (joint.rotation().row(2) * bodies[k].points).transpose().array() +
                   joint.translation().z() - bodies[k].radius.array();
      if (heights[k].size() > 0) lowest = std::min(lowest, heights[k].minCoeff());
    }
    for (std::size_t k = 0; k < bodies.size(); ++k) {
      const pinocchio::SE3 relative = data.oMi[1].actInv(data.oMi[bodies[k].joint]);
      for (Index point = 0; point < heights[k].size(); ++point) {
        const double height = heights[k][point];
        double above = height - lowest;
        const auto level = std::upper_bound(levels.begin(), levels.end(), height);
        if (level != levels.begin()) above = std::min(above, height - *(level - 1));
        const double score = std::max(0., reach - above);
        scores[k][point] += score;
        places[k].col(point) += score * relative.act(Eigen::Vector3d(bodies[k].points.col(point)));
      }
    }
  }

  std::vector<Candidate> candidates;
  for (std::size_t k = 0; k < bodies.size(); ++k)
    for (Index point = 0; point < scores[k].size(); ++point)
      if (scores[k][point] > 0.)
        candidates.push_back({k, point, scores[k][point], places[k].col(point) / scores[k][point],
                              std::numeric_limits<double>::infinity(), false});
  // Low ones, and those that are apart: what carries is as wide as possible.
  std::vector<std::vector<Index>> chosen(bodies.size());
  for (std::size_t count = 0; count < std::min(most, candidates.size()); ++count) {
    Candidate* best = nullptr;
    double best_value = -1.;
    for (Candidate& candidate : candidates) {
      const double value = candidate.score * std::min(1., candidate.distance / kApart);
      if (candidate.is_chosen || value <= best_value) continue;
      best = &candidate;
      best_value = value;
    }
    best->is_chosen = true;
    chosen[best->body].push_back(best->point);
    for (Candidate& candidate : candidates)
      candidate.distance = std::min(candidate.distance, (candidate.place - best->place).norm());
  }
  std::vector<BodyPoints> screened;
  for (std::size_t k = 0; k < bodies.size(); ++k) {
    if (chosen[k].empty()) continue;
    std::sort(chosen[k].begin(), chosen[k].end());
    BodyPoints body{bodies[k].link, bodies[k].joint, {}, {}};
    const auto size = static_cast<Index>(chosen[k].size());
    body.points.resize(3, size);
    body.radius.resize(size);
    for (Index i = 0; i < size; ++i) {
      const Index point = chosen[k][static_cast<std::size_t>(i)];
      body.points.col(i) = bodies[k].points.col(point);
      body.radius[i] = bodies[k].radius[point];
    }
    screened.push_back(std::move(body));
  }
  return screened;
}

}  // namespace dynacom::internal
