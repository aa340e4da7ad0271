// SPDX-License-Identifier: BSD-2-Clause
#include "centroidal_filter.hpp"

#include <algorithm>
#include <cmath>
#include <memory>
#include <ostream>

#include "../check.hpp"
#include "../motion_check.hpp"
#include "../settings_fields.hpp"
#include "../standard_gravity.hpp"
#include "centroidal_window.hpp"
#include "part_sets.hpp"

namespace dynacom {

using Eigen::Index;
using internal::requireSize;

const std::vector<CentroidalFilterSettings::Field>& CentroidalFilterSettings::fields() {
  static const std::vector<Field> all = {
      {"com", &CentroidalFilterSettings::com},
      {"com_acceleration", &CentroidalFilterSettings::com_acceleration},
      {"angular_momentum", &CentroidalFilterSettings::angular_momentum},
      {"reach", &CentroidalFilterSettings::reach},
      {"change", &CentroidalFilterSettings::change},
      {"maximal_iterations", &CentroidalFilterSettings::maximal_iterations},
      {"window", &CentroidalFilterSettings::window},
      {"overlap", &CentroidalFilterSettings::overlap},
  };
  return all;
}

void CentroidalFilterSettings::validate() const {
  internal::requirePositive("CentroidalFilterSettings", *this, fields());
}

std::string CentroidalFilterSettings::to_string() const { return internal::concat(*this); }

bool CentroidalFilterSettings::operator==(const CentroidalFilterSettings& other) const {
  return internal::areEqual(*this, other, fields());
}

std::ostream& operator<<(std::ostream& out, const CentroidalFilterSettings& settings) {
  out << "CentroidalFilterSettings(";
  internal::write(out, settings, CentroidalFilterSettings::fields());
  return out << ")";
}

namespace {

using internal::CentroidalProblem;
using internal::CentroidalWindow;
using internal::ConeProjection;

// A window of frames, and those of it that are kept: the others belong to its neighbours.
struct Window {
  Index first, behind;
  Index first_kept, behind_kept;
};

void requireFitting(const internal::ContactSplit& parts, const std::vector<ContactMotion>& motions,
                    const MotionAnalysis& dynamics,
                    const Eigen::Array<bool, Eigen::Dynamic, 1>& free) {
  const Index frames = dynamics.time.size();
  const std::size_t count = parts.parts.size();
  internal::requireTime(dynamics.time);
  requireSize("motions", motions.size(), count, "parts");
  for (const ContactMotion& motion : motions)
    requireSize("motions", motion.position.cols(), frames, "frames (as many as dynamics)");
  for (const auto* values : {&dynamics.com, &dynamics.ground_force, &dynamics.ground_torque}) {
    requireSize("dynamics", values->cols(), frames, "frames");
    if (!values->allFinite())
      internal::throwInvalid("dynamics must have finite CoM and ground wrench");
  }
  if (free.size() != 0) requireSize("free", free.size(), frames, "frames (or none)");
}

CentroidalProblem describe(const internal::ContactSplit& parts,
                           const std::vector<ContactMotion>& motions,
                           const MotionAnalysis& dynamics, const ContactSchedule& schedule,
                           const Eigen::Array<bool, Eigen::Dynamic, 1>& free) {
  const Index frames = dynamics.time.size();
  CentroidalProblem problem;
  problem.time = dynamics.time;
  problem.com = dynamics.com;
  problem.wrench.resize(6, frames);
  problem.wrench << dynamics.ground_force, dynamics.ground_torque;
  problem.gravity = internal::findUnitGravity(parts.carrier.gravity);
  problem.wrench /= parts.carrier.mass * problem.gravity;
  for (const ContactMotion& motion : motions) problem.points.push_back(&motion.position);
  problem.friction = internal::listFriction(parts);
  problem.sets = internal::listSets(parts.parts, schedule, frames);
  problem.free = free;
  if (free.size() == 0) problem.free.setConstant(frames, false);
  return problem;
}

// Frames whose wrench is out of reach.
std::vector<Index> findOutOfReach(const CentroidalProblem& problem, double reach) {
  std::vector<Index> found;
  ConeProjection projection(1.);
  Eigen::Matrix3Xd levers(3, Index(problem.points.size()));
  for (Index frame = 0; frame < problem.time.size(); ++frame) {
    if (problem.free[frame]) continue;
    for (std::size_t k = 0; k < problem.points.size(); ++k)
      levers.col(Index(k)) = problem.points[k]->col(frame) - problem.com.col(frame);
    const auto missing = projection.project(problem.wrench.col(frame), levers, problem.friction,
                                            problem.sets[static_cast<std::size_t>(frame)]);
    if (std::max(missing.force, missing.torque) > reach) found.push_back(frame);
  }
  return found;
}

// Whatever is closer than the overlap to a frame out of reach, in windows.
std::vector<Window> makeWindows(const CentroidalProblem& problem,
                                const CentroidalFilterSettings& settings) {
  const Eigen::VectorXd& time = problem.time;
  const auto begin = time.data(), end = begin + time.size();
  const auto firstFrom = [&](double moment) {
    return std::lower_bound(begin, end, moment) - begin;
  };
  std::vector<std::pair<Index, Index>> islands;
  for (const Index frame : findOutOfReach(problem, settings.reach)) {
    const Index first = firstFrom(time[frame] - settings.overlap);
    const Index behind = firstFrom(time[frame] + settings.overlap);
    if (!islands.empty() && first <= islands.back().second)
      islands.back().second = std::max(behind, islands.back().second);
    else
      islands.emplace_back(first, std::max(behind, frame + 1));
  }
  std::vector<Window> windows;
  for (const auto& [first, behind] : islands) {
    const double since = time[first], lasts = time[behind - 1] - since;
    const double count = std::max(1., std::ceil((lasts - 2. * settings.overlap) / settings.window));
    Index first_kept = first;
    for (double k = 1.; k <= count; ++k) {
      const Index behind_kept = k == count ? behind : firstFrom(since + lasts * k / count);
      if (behind_kept <= first_kept) continue;
      windows.push_back({std::max(first, firstFrom(time[first_kept] - settings.overlap)),
                         std::min(behind, firstFrom(time[behind_kept - 1] + settings.overlap) + 1),
                         first_kept, behind_kept});
      first_kept = behind_kept;
    }
  }
  return windows;
}

}  // namespace

CentroidalChange internal::distanceToFeasible(const ContactSplit& parts,
                                              const std::vector<ContactMotion>& motions,
                                              const MotionAnalysis& dynamics,
                                              const ContactSchedule& schedule,
                                              const CentroidalFilterSettings& settings,
                                              const Eigen::Array<bool, Eigen::Dynamic, 1>& free,
                                              Workers& workers) {
  settings.validate();
  requireFitting(parts, motions, dynamics, free);
  const CentroidalProblem problem = describe(parts, motions, dynamics, schedule, free);
  const Index frames = problem.time.size();
  const double weight = parts.carrier.mass * problem.gravity;
  CentroidalChange found;
  found.com.setZero(3, frames);
  found.angular_momentum.setZero(3, frames);
  found.residual.setZero(6, frames);
  const std::vector<Window> windows = makeWindows(problem, settings);
  std::vector<int> iterations(windows.size());
  std::vector<char> converged(windows.size());
  workers.forEach(Index(windows.size()), [&]() -> Workers::Work {
    const auto solver = std::make_shared<CentroidalWindow>(problem, settings);
    return [&, solver](Index index) {
      const auto at = static_cast<std::size_t>(index);
      const Window& window = windows[at];
      solver->solve(window.first, window.behind - window.first);
      iterations[at] = solver->iterations();
      converged[at] = solver->converged();
      for (Index frame = window.first_kept; frame < window.behind_kept; ++frame) {
        const Index k = frame - window.first;
        found.com.col(frame) = solver->displacement(k);
        found.angular_momentum.col(frame) = weight * solver->angularMomentum(k);
        found.residual.col(frame) = weight * solver->residual(k);
      }
    };
  });
  for (std::size_t k = 0; k < windows.size(); ++k) {
    found.iterations = std::max(found.iterations, iterations[k]);
    found.converged = found.converged && converged[k];
  }
  if (frames == 0) return found;
  const Eigen::VectorXd distances = found.com.colwise().norm();
  found.rms = std::sqrt(distances.squaredNorm() / double(frames));
  found.largest = distances.maxCoeff(&found.frame);
  return found;
}

CentroidalChange distanceToFeasible(const PartRobot& parts,
                                    const std::vector<ContactMotion>& motions,
                                    const MotionAnalysis& dynamics, const ContactSchedule& schedule,
                                    const CentroidalFilterSettings& settings,
                                    const Eigen::Array<bool, Eigen::Dynamic, 1>& free,
                                    int threads) {
  internal::requireField(threads >= 0, "threads", ">= 0", threads);
  internal::Workers workers(threads);
  return internal::distanceToFeasible(internal::describeSplit(parts), motions, dynamics, schedule,
                                      settings, free, workers);
}

}  // namespace dynacom
