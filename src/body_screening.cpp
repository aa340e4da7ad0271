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

// Frames that are looked at are so far apart [s]: who is low for less does not lie or kneel.
constexpr double kStep = 0.04;

// A link's points, and what became of them in the frames that were looked at.
struct Screened {
  explicit Screened(const BodyPoints& body)
      : body(body),
        scores(Eigen::VectorXd::Zero(body.points.cols())),
        places(Eigen::Matrix3Xd::Zero(3, body.points.cols())) {
    if (body.points.cols() == 0) return;
    centre = 0.5 * (body.points.rowwise().minCoeff() + body.points.rowwise().maxCoeff());
    size = ((body.points.colwise() - centre).colwise().norm().transpose() + body.radius).maxCoeff();
  }

  const BodyPoints& body;
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();
  double size = 0.;         // no part of it is farther from its centre
  Eigen::VectorXd scores;   // how deep within reach points were, summed over frames
  Eigen::Matrix3Xd places;  // where they were then, in the root's axes, weighed by that
  // In the frame at hand.
  double least = 0.;        // it is no lower than this
  Eigen::VectorXd heights;  // of its points' lowest; nothing where nobody has asked
};

struct Candidate {
  std::size_t link;
  Index point;
  double score;           // how deep within reach it was, summed over frames
  Eigen::Vector3d place;  // mean of where it was then, in the root's axes
  double distance;        // to the closest one that was chosen
  bool is_chosen;
};

}  // namespace

std::vector<BodyPoints> screenBodies(const pinocchio::Model& model, pinocchio::Data& data,
                                     const std::vector<BodyPoints>& bodies, const Motion& motion,
                                     const Eigen::Array<bool, Eigen::Dynamic, 1>& missing,
                                     std::vector<double> levels, double reach, std::size_t most) {
  std::sort(levels.begin(), levels.end());
  std::vector<Screened> links;
  for (const BodyPoints& body : bodies)
    if (body.points.cols() > 0) links.emplace_back(body);
  double next = -std::numeric_limits<double>::infinity();
  for (Index frame = 0; frame < motion.frames(); ++frame) {
    if (!missing[frame] || motion.time[frame] < next) continue;
    next = motion.time[frame] + kStep;
    pinocchio::forwardKinematics(model, data, motion.q.col(frame));
    const auto findHeights = [&](Screened& link) {
      const pinocchio::SE3& joint = data.oMi[link.body.joint];
      link.heights.noalias() = (joint.rotation().row(2) * link.body.points).transpose();
      link.heights.array() += joint.translation().z() - link.body.radius.array();
    };
    // Only of links that may be the lowest, or low enough, it matters how high each point is.
    double lowest = levels.empty() ? std::numeric_limits<double>::infinity() : levels.front();
    for (Screened& link : links) {
      link.least = data.oMi[link.body.joint].act(link.centre).z() - link.size;
      link.heights.resize(0);
      if (link.least >= lowest) continue;
      findHeights(link);
      lowest = std::min(lowest, link.heights.minCoeff());
    }
    const double highest = std::max(lowest, levels.empty() ? lowest : levels.back());
    for (Screened& link : links) {
      if (link.least > highest + reach) continue;
      if (link.heights.size() == 0) findHeights(link);
      const pinocchio::SE3 relative = data.oMi[1].actInv(data.oMi[link.body.joint]);
      for (Index point = 0; point < link.heights.size(); ++point) {
        const double height = link.heights[point];
        double above = height - lowest;
        const auto level = std::upper_bound(levels.begin(), levels.end(), height);
        if (level != levels.begin()) above = std::min(above, height - *(level - 1));
        if (!(above < reach)) continue;
        const double score = reach - above;
        link.scores[point] += score;
        link.places.col(point) +=
            score * relative.act(Eigen::Vector3d(link.body.points.col(point)));
      }
    }
  }

  std::vector<Candidate> candidates;
  for (std::size_t k = 0; k < links.size(); ++k)
    for (Index point = 0; point < links[k].scores.size(); ++point) {
      const double score = links[k].scores[point];
      if (score > 0.)
        candidates.push_back({k, point, score, links[k].places.col(point) / score,
                              std::numeric_limits<double>::infinity(), false});
    }
  // Low ones, and those that are apart: what carries is as wide as possible.
  std::vector<std::vector<Index>> chosen(links.size());
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
    chosen[best->link].push_back(best->point);
    for (Candidate& candidate : candidates)
      candidate.distance = std::min(candidate.distance, (candidate.place - best->place).norm());
  }
  std::vector<BodyPoints> screened;
  for (std::size_t k = 0; k < links.size(); ++k) {
    if (chosen[k].empty()) continue;
    std::sort(chosen[k].begin(), chosen[k].end());
    const BodyPoints& all = links[k].body;
    BodyPoints body{all.link, all.joint, {}, {}};
    const auto size = static_cast<Index>(chosen[k].size());
    body.points.resize(3, size);
    body.radius.resize(size);
    for (Index i = 0; i < size; ++i) {
      const Index point = chosen[k][static_cast<std::size_t>(i)];
      body.points.col(i) = all.points.col(point);
      body.radius[i] = all.radius[point];
    }
    screened.push_back(std::move(body));
  }
  return screened;
}

}  // namespace dynacom::internal
