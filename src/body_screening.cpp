// SPDX-License-Identifier: BSD-2-Clause
#include "body_screening.hpp"

#include <algorithm>
#include <limits>
#include <pinocchio/algorithm/kinematics.hpp>

namespace dynacom::internal {

using Eigen::Index;

namespace {

// Points of a link, besides the first, that are worth having.
constexpr std::size_t kMostOfLink = 6;

struct Candidate {
  std::size_t body;
  Index point;
  double score;  // how deep within reach it was, summed over frames
};

}  // namespace

std::vector<BodyPoints> screenBodies(const pinocchio::Model& model,
                                     const std::vector<BodyPoints>& bodies, const Motion& motion,
                                     const Eigen::Array<bool, Eigen::Dynamic, 1>& missing,
                                     std::vector<double> levels, double reach, std::size_t most) {
  std::sort(levels.begin(), levels.end());
  pinocchio::Data data(model);
  std::vector<Eigen::VectorXd> scores, heights;
  for (const BodyPoints& body : bodies) scores.push_back(Eigen::VectorXd::Zero(body.points.cols()));
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
    for (std::size_t k = 0; k < bodies.size(); ++k)
      for (Index point = 0; point < heights[k].size(); ++point) {
        const double height = heights[k][point];
        double above = height - lowest;
        const auto level = std::upper_bound(levels.begin(), levels.end(), height);
        if (level != levels.begin()) above = std::min(above, height - *(level - 1));
        scores[k][point] += std::max(0., reach - above);
      }
  }

  std::vector<Candidate> candidates;
  for (std::size_t k = 0; k < bodies.size(); ++k)
    for (Index point = 0; point < scores[k].size(); ++point)
      if (scores[k][point] > 0.) candidates.push_back({k, point, scores[k][point]});
  std::stable_sort(candidates.begin(), candidates.end(),
                   [](const Candidate& a, const Candidate& b) { return a.score > b.score; });
  std::vector<std::vector<Index>> chosen(bodies.size());
  std::size_t count = 0;
  for (std::size_t round = 0; round < kMostOfLink && count < most; ++round) {
    // In each round the best of each link that is left.
    std::vector<bool> taken(bodies.size(), false);
    for (Candidate& candidate : candidates) {
      if (count >= most) break;
      if (candidate.point < 0 || taken[candidate.body]) continue;
      taken[candidate.body] = true;
      chosen[candidate.body].push_back(candidate.point);
      candidate.point = -1;
      ++count;
    }
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
