// SPDX-License-Identifier: BSD-2-Clause
#include "dynacom/motion_repair.hpp"

#include <Eigen/Geometry>
#include <Eigen/QR>
#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <ostream>
#include <pinocchio/algorithm/joint-configuration.hpp>
#include <pinocchio/algorithm/kinematics.hpp>
#include <pinocchio/spatial.hpp>

#include "../check.hpp"
#include "../motion_check.hpp"
#include "../nan.hpp"
#include "../settings_fields.hpp"
#include "../standard_gravity.hpp"
#include "dynacom/contact_point.hpp"
#include "part_sets.hpp"
#include "whole_body_window.hpp"

namespace dynacom {

using Eigen::Index;

const std::vector<RepairSettings::Field>& RepairSettings::fields() {
  static const std::vector<Field> all = {
      {"displacement", &RepairSettings::displacement},
      {"turn", &RepairSettings::turn},
      {"linear_acceleration", &RepairSettings::linear_acceleration},
      {"angular_acceleration", &RepairSettings::angular_acceleration},
      {"friction_margin", &RepairSettings::friction_margin},
      {"support_margin", &RepairSettings::support_margin},
      {"held_point", &RepairSettings::held_point},
      {"largest_drift", &RepairSettings::largest_drift},
      {"slide_speed", &RepairSettings::slide_speed},
      {"largest_shift", &RepairSettings::largest_shift},
      {"clearance", &RepairSettings::clearance},
      {"joint_margin", &RepairSettings::joint_margin},
      {"speed_margin", &RepairSettings::speed_margin},
      {"window", &RepairSettings::window},
      {"overlap", &RepairSettings::overlap},
  };
  return all;
}

const std::vector<RepairSettings::Switch>& RepairSettings::switches() {
  static const std::vector<Switch> all = {
      {"feet", &RepairSettings::feet},
      {"joints", &RepairSettings::joints},
      {"pinned_ends", &RepairSettings::pinned_ends},
  };
  return all;
}

void RepairSettings::validate() const {
  internal::requirePositive("RepairSettings", *this, fields(),
                            {&RepairSettings::friction_margin, &RepairSettings::support_margin,
                             &RepairSettings::largest_drift, &RepairSettings::clearance,
                             &RepairSettings::joint_margin, &RepairSettings::speed_margin});
  for (const auto& [name, margin] :
       {std::pair("friction_margin", friction_margin), std::pair("speed_margin", speed_margin)})
    internal::requireField(margin < 1., internal::concat("RepairSettings.", name).c_str(), "< 1",
                           margin);
}

std::string RepairSettings::to_string() const { return internal::concat(*this); }

bool RepairSettings::operator==(const RepairSettings& other) const {
  const auto is_same = [&](const Switch& own) { return this->*own.second == other.*own.second; };
  return internal::areEqual(*this, other, fields()) &&
         std::all_of(switches().begin(), switches().end(), is_same);
}

std::ostream& operator<<(std::ostream& out, const RepairSettings& settings) {
  out << "RepairSettings(";
  internal::write(out, settings, RepairSettings::fields());
  for (const auto& [name, value] : RepairSettings::switches())
    out << ", " << name << "=" << (settings.*value ? "True" : "False");
  return out << ")";
}

namespace {

using internal::BodyPoint;
using internal::WholeBodyProblem;

// Wrenches that lack no more than this part of the weight are within reach.
constexpr double kReach = 1e-7;
// Parts that are no farther from where they are to be stay there [m].
constexpr double kPlace = 1e-3;
// By how much faster contacts may slide where they would have to be displaced too far.
constexpr double kFaster = 1.8;

std::vector<BodyPoint> listPoints(const internal::ContactSplit& parts) {
  std::vector<BodyPoint> points;
  for (const internal::FixedContact& fixed : parts.carrier.contacts) {
    const auto& settings = dynamic_cast<const ContactPoint&>(*fixed.contact).getSettings();
    BodyPoint point = {fixed.joint, fixed.placement.translation()};
    if (settings.world_aligned)
      point.drop = settings.radius;
    else
      point.place -= settings.radius * fixed.placement.rotation().col(2);
    points.push_back(point);
  }
  return points;
}

// Costs of the squares of changes, or of their accelerations, in the tangent space.
Eigen::VectorXd listCosts(const pinocchio::Model& model, double linear, double angular) {
  const Eigen::Index nv = model.nv;
  const Eigen::VectorXd scale = internal::findSliding(model).select(
      Eigen::VectorXd::Constant(nv, linear), Eigen::VectorXd::Constant(nv, angular));
  return scale.array().square().inverse();
}

// Where the parts of each contact are, and are to be, while they carry.
class Footwork {
 public:
  Footwork(const internal::ContactSplit& parts, WholeBodyProblem& problem,
           const RepairSettings& settings, const RepairGround& ground)
      : parts_(parts), problem_(problem), settings_(settings), ground_(ground) {
    pinocchio::Data data(problem.model);
    const Index frames = problem.time.size();
    problem.targets.assign(problem.points.size(), Eigen::Matrix3Xd(3, frames));
    problem.held = problem.sets;
    placements_.resize(problem.points.size());
    for (Index frame = 0; frame < frames; ++frame) {
      pinocchio::forwardKinematics(problem.model, data, problem.q.col(frame));
      for (std::size_t k = 0; k < problem.points.size(); ++k) {
        placements_[k].push_back(data.oMi[problem.points[k].joint]);
        problem.targets[k].col(frame) = locate(k, placements_[k].back());
        // Where it is on the ground, which may move.
        placements_[k].back().translation() -= moved(frame);
      }
    }
  }

  std::vector<RepairedStance> find() {
    std::vector<RepairedStance> stances;
    const Index frames = problem_.time.size();
    for (std::size_t first_part = 0; first_part < parts_.parts.size();) {
      const std::size_t contact = parts_.parts[first_part].contact;
      std::uint32_t mask = 0;
      std::size_t part = first_part;
      for (; part < parts_.parts.size() && parts_.parts[part].contact == contact; ++part)
        mask |= std::uint32_t(1) << part;
      for (Index first = 0, behind = 0; first < frames; first = behind) {
        behind = first + 1;
        if ((setOf(first) & mask) == 0) continue;
        while (behind < frames && (setOf(behind) & mask) != 0) ++behind;
        stances.push_back(stand(contact, first_part, mask, first, behind));
      }
      first_part = part;
    }
    if (settings_.feet) arrive();
    if (settings_.feet && ground_.height.rows() > 0) clear();
    return stances;
  }

 private:
  std::uint32_t setOf(Index frame) const { return problem_.sets[static_cast<std::size_t>(frame)]; }

  // Parts are where they carry one frame before, and after, too: who lands or leaves does so at
  // rest.
  void arrive() {
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
  void clear() {
    constexpr double kAcceleration = 10.;  // [m/s²]
    const Index frames = problem_.time.size();
    problem_.floor = ground_.height;
    for (Index first = 0, behind = 0; first < problem_.floor.rows(); first = behind) {
      std::uint32_t mask = 0;
      const std::size_t contact = parts_.parts[std::size_t(first)].contact;
      for (; behind < problem_.floor.rows() && parts_.parts[std::size_t(behind)].contact == contact;
           ++behind)
        mask |= std::uint32_t(1) << behind;
      Eigen::VectorXd away =
          Eigen::VectorXd::Constant(frames, std::numeric_limits<double>::infinity());
      const auto measureFrom = [&](Index from, Index to) {
        away[to] = (setOf(to) & mask) != 0
                       ? 0.
                       : std::min(away[to],
                                  away[from] + std::abs(problem_.time[to] - problem_.time[from]));
      };
      measureFrom(0, 0);
      for (Index frame = 1; frame < frames; ++frame) measureFrom(frame - 1, frame);
      for (Index frame = frames - 1; frame > 0; --frame) measureFrom(frame, frame - 1);
      for (Index frame = 0; frame < frames; ++frame)
        problem_.floor.block(first, frame, behind - first, 1).array() +=
            std::min(settings_.clearance, 0.5 * kAcceleration * away[frame] * away[frame]);
    }
  }

  Eigen::Vector3d moved(Index frame) const {
    return (problem_.time[frame] - problem_.time[0]) * ground_.velocity;
  }

  Eigen::Vector3d locate(std::size_t part, const pinocchio::SE3& placement) const {
    Eigen::Vector3d place = placement.act(problem_.points[part].place);
    place.z() -= problem_.points[part].drop;
    return place;
  }

  // Of the ground under a part, NaN where that is not known.
  double height(std::size_t part, Index frame) const {
    return settings_.feet && ground_.height.rows() > 0 ? ground_.height(Index(part), frame)
                                                       : internal::kNaN;
  }

  // Turns and lifts a placement of a contact such that parts of it are as close to the ground under
  // them as can be.
  pinocchio::SE3 level(const pinocchio::SE3& placement, const std::vector<std::size_t>& parts,
                       const std::vector<double>& ground) const {
    constexpr int kIterations = 3;
    const auto count = Index(parts.size());
    pinocchio::SE3 levelled = placement;
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

  // The mean of a contact's placements, without those in which fewer parts carry than in others:
  // the mean rotation, and the parts that carry where they are on average.
  pinocchio::SE3 average(const std::vector<pinocchio::SE3>& placements,
                         const std::vector<std::uint32_t>& carrying, Index first) const {
    int most = 0;
    for (const std::uint32_t set : carrying) most = std::max(most, __builtin_popcount(set));
    const auto forEach = [&](const auto& act) {
      for (std::size_t k = 0; k < carrying.size(); ++k)
        if (__builtin_popcount(carrying[k]) == most)
          act(placements[std::size_t(first) + k], carrying[k]);
    };
    Eigen::Vector4d sum = Eigen::Vector4d::Zero();
    forEach([&](const pinocchio::SE3& placement, std::uint32_t) {
      const Eigen::Vector4d own = Eigen::Quaterniond(placement.rotation()).coeffs();
      sum += own.dot(sum) < 0. ? Eigen::Vector4d(-own) : own;
    });
    const pinocchio::SE3 turned(Eigen::Quaterniond(Eigen::Vector4d(sum.normalized())),
                                Eigen::Vector3d::Zero());
    Eigen::Vector3d place = Eigen::Vector3d::Zero();
    double count = 0.;
    forEach([&](const pinocchio::SE3& placement, std::uint32_t set) {
      place += centre(set, placement) - centre(set, turned);
      ++count;
    });
    return {turned.rotation(), place / count};
  }

  // Where parts are on average with a placement.
  Eigen::Vector3d centre(std::uint32_t parts, const pinocchio::SE3& placement) const {
    Eigen::Vector3d sum = Eigen::Vector3d::Zero();
    for (std::uint32_t rest = parts; rest != 0; rest &= rest - 1)
      sum += locate(static_cast<std::size_t>(__builtin_ctz(rest)), placement);
    return sum / double(__builtin_popcount(parts));
  }

  // Placements of a contact in a stance in which no part slides faster than it may. Where that
  // would lead too far from where it was, it may be faster; who slides in earnest goes on as it
  // did.
  std::vector<pinocchio::SE3> slowDown(std::size_t first_part, std::uint32_t mask, Index first,
                                       Index behind) const {
    const auto begin = placements_[first_part].begin();
    const std::vector<pinocchio::SE3> path(begin + first, begin + behind);
    for (const double factor : {1., kFaster}) {
      std::vector<pinocchio::SE3> slow =
          slowDown(path, mask, first, factor * settings_.slide_speed);
      double farthest = 0.;
      for (std::size_t k = 0; k < path.size(); ++k)
        if (const std::uint32_t set = setOf(first + Index(k)) & mask; set != 0)
          farthest = std::max(farthest, (centre(set, slow[k]) - centre(set, path[k])).norm());
      if (farthest <= settings_.largest_shift) return slow;
    }
    return path;
  }

  // It stays where it is slowest, and goes on from there both ways, back to where it was as fast as
  // it may. Parts slide half of that with their centre, and half around it.
  std::vector<pinocchio::SE3> slowDown(const std::vector<pinocchio::SE3>& path, std::uint32_t mask,
                                       Index first, double speed_limit) const {
    const Index behind = first + Index(path.size());
    std::vector<pinocchio::SE3> slow = path;
    const auto bothOf = [&](Index k) { return setOf(first + k) & setOf(first + k + 1) & mask; };
    Index slowest = 0;
    double least = std::numeric_limits<double>::infinity();
    for (Index k = 0; k + 1 < behind - first; ++k) {
      if (bothOf(k) == 0) continue;
      const Eigen::Vector3d slide =
          centre(bothOf(k), path[std::size_t(k + 1)]) - centre(bothOf(k), path[std::size_t(k)]);
      const double speed = slide.norm() / stepAt(first + k);
      if (speed >= least) continue;
      least = speed;
      slowest = k;
    }
    for (Index k = slowest; k + 1 < behind - first; ++k)
      slow[std::size_t(k + 1)] =
          follow(path[std::size_t(k)], slow[std::size_t(k)], path[std::size_t(k + 1)], mask,
                 bothOf(k), speed_limit * stepAt(first + k));
    for (Index k = slowest; k > 0; --k)
      slow[std::size_t(k - 1)] =
          follow(path[std::size_t(k)], slow[std::size_t(k)], path[std::size_t(k - 1)], mask,
                 bothOf(k - 1), speed_limit * stepAt(first + k - 1));
    return slow;
  }

  double stepAt(Index frame) const { return problem_.time[frame + 1] - problem_.time[frame]; }

  // What follows a placement `there` that was `here`, if what carries slides no faster than it may.
  pinocchio::SE3 follow(const pinocchio::SE3& here, const pinocchio::SE3& slow_here,
                        const pinocchio::SE3& there, std::uint32_t mask, std::uint32_t carrying,
                        double farthest) const {
    const auto limit = [](double value, double largest) {
      return std::clamp(value, -largest, largest);
    };
    // Of the slow one against the other, about the vertical.
    const auto yawOf = [](const Eigen::Matrix3d& rotation) {
      return pinocchio::log3(rotation).z();
    };
    const double extra = yawOf(slow_here.rotation() * here.rotation().transpose());
    if (carrying == 0) return there;
    const Eigen::Vector3d middle = centre(carrying, there),
                          slow_middle = centre(carrying, slow_here);
    double lever = 0.;
    for (std::uint32_t rest = mask; rest != 0; rest &= rest - 1)
      lever = std::max(
          lever, (locate(static_cast<std::size_t>(__builtin_ctz(rest)), there) - middle).norm());
    const double largest = 0.5 * farthest;
    const double yaw = yawOf(there.rotation() * here.rotation().transpose());
    const double other_extra =
        extra - yaw + (lever > 0. ? limit(yaw - extra, largest / lever) : yaw - extra);
    Eigen::Vector3d slide = middle - slow_middle;
    const double size = slide.head<2>().norm();
    if (size > largest) slide.head<2>() *= largest / size;
    const Eigen::Matrix3d turn =
        Eigen::AngleAxisd(other_extra, Eigen::Vector3d::UnitZ()).toRotationMatrix();
    return {turn * there.rotation(), slow_middle + slide + turn * (there.translation() - middle)};
  }

  // The same of the parts of a set, with the ground of a frame, as far as that is known.
  pinocchio::SE3 level(const pinocchio::SE3& placement, std::uint32_t set, Index frame) const {
    std::vector<std::size_t> known;
    std::vector<double> ground;
    for (; set != 0; set &= set - 1) {
      const auto part = static_cast<std::size_t>(__builtin_ctz(set));
      const double under = height(part, frame);
      if (std::isnan(under)) continue;
      known.push_back(part);
      ground.push_back(under);
    }
    return level(placement, known, ground);
  }

  RepairedStance stand(std::size_t contact, std::size_t first_part, std::uint32_t mask, Index first,
                       Index behind) {
    const auto& placements = placements_[first_part];
    std::vector<std::uint32_t> carrying;
    for (Index frame = first; frame < behind; ++frame) carrying.push_back(setOf(frame) & mask);
    const pinocchio::SE3 mean = average(placements, carrying, first);
    RepairedStance stance = {contact, first, behind, 0., false};
    const auto forEachCarrying = [&](const auto& act) {
      for (Index frame = first; frame < behind; ++frame)
        for (std::uint32_t rest = setOf(frame) & mask; rest != 0; rest &= rest - 1)
          act(static_cast<std::size_t>(__builtin_ctz(rest)), frame);
    };
    std::map<std::size_t, std::pair<double, int>> heights;  // sums, and of how many
    forEachCarrying([&](std::size_t part, Index frame) {
      const Eigen::Vector3d place = locate(part, mean) + moved(frame);
      stance.drift = std::max(stance.drift, (problem_.targets[part].col(frame) - place).norm());
      const double under = height(part, frame);
      if (std::isnan(under)) return;
      heights[part].first += under;
      ++heights[part].second;
    });
    if (!settings_.feet) return stance;
    stance.is_still = stance.drift <= settings_.largest_drift;
    std::vector<std::size_t> known;
    std::vector<double> ground;
    for (const auto& [part, sum] : heights) {
      known.push_back(part);
      ground.push_back(sum.first / sum.second);
    }
    const pinocchio::SE3 still = level(mean, known, ground);
    std::vector<pinocchio::SE3> slow;
    if (!stance.is_still) slow = slowDown(first_part, mask, first, behind);
    for (Index frame = first; frame < behind; ++frame) {
      const pinocchio::SE3 placement =
          stance.is_still ? still
                          : level(slow[std::size_t(frame - first)], setOf(frame) & mask, frame);
      for (std::uint32_t rest = setOf(frame) & mask; rest != 0; rest &= rest - 1) {
        const auto part = static_cast<std::size_t>(__builtin_ctz(rest));
        problem_.targets[part].col(frame) = locate(part, placement) + moved(frame);
      }
    }
    return stance;
  }

  const internal::ContactSplit& parts_;
  WholeBodyProblem& problem_;
  const RepairSettings& settings_;
  const RepairGround& ground_;
  std::vector<std::vector<pinocchio::SE3>> placements_;  // of each part's joint, by frame
};

// What contacts cannot give, over the weight, and how far what carries is from its place.
double measure(const WholeBodyProblem& problem, const Eigen::MatrixXd& ground,
               const Eigen::MatrixXd& q, RepairedMotion& found) {
  internal::MotionLinearizer linearizer(problem.model, problem.points);
  internal::ConeProjection projection(1., internal::ConeProjection::kExact);
  internal::LinearizedFrame needed;
  found.residual.setZero(6, problem.time.size());
  found.held_largest = found.sunk_largest = 0.;
  double worst = 0.;
  for (Index frame = 0; frame < problem.time.size(); ++frame) {
    const std::uint32_t set = problem.sets[static_cast<std::size_t>(frame)];
    linearizer.evaluate(problem.time, q, frame, needed);
    for (std::size_t part = 0; part < problem.points.size(); ++part) {
      const auto place = needed.points.col(Index(part));
      if (set >> part & 1u)
        found.held_largest =
            std::max(found.held_largest, (place - problem.targets[part].col(frame)).norm());
      else if (ground.rows() > 0)  // std::max() leaves what is not known
        found.sunk_largest = std::max(found.sunk_largest, ground(Index(part), frame) - place.z());
    }
    if (problem.free[frame]) continue;
    if (!needed.wrench.allFinite())
      internal::throwInvalid("motion: what frame ", frame, " needs is too large for numbers");
    found.residual.col(frame) = findResidual(projection, needed, problem.mu, set);
    worst = std::max(worst, found.residual.col(frame).norm());
  }
  return worst;
}

// How far joints are beyond their limits.
void measureJoints(const WholeBodyProblem& problem, const Eigen::MatrixXd& q,
                   RepairedMotion& found) {
  found.joint_excess = found.speed_excess = 0.;
  for (const internal::LimitedJoint& joint : internal::listLimits(problem.model, 0., 0.))
    for (Index frame = 0; frame < problem.time.size(); ++frame)
      for (const internal::LimitKind kind : internal::kLimitKinds) {
        const double excess = measureExcess(joint, kind, problem.time, q, frame);
        if (excess <= 0.) continue;
        if (!isOfStep(kind))
          found.joint_excess = std::max(found.joint_excess, excess);
        else
          found.speed_excess =
              std::max(found.speed_excess,
                       excess / (joint.speed * (problem.time[frame + 1] - problem.time[frame])));
      }
}

// Changes begin with those that lead to `start`.
void repairInWindows(const WholeBodyProblem& problem, const RepairSettings& settings,
                     const Eigen::MatrixXd& start, bool is_mended, Eigen::MatrixXd& change,
                     Eigen::MatrixXd& q) {
  internal::WholeBodyWindow window(problem, settings);
  const Eigen::VectorXd& time = problem.time;
  for (Index frame = 0; frame < time.size(); ++frame)
    change.col(frame) =
        pinocchio::difference(problem.model, problem.q.col(frame), start.col(frame));
  q = start;
  const Eigen::MatrixXd at_start = change;
  const auto frameAt = [&](double moment) {
    return Index(std::lower_bound(time.data(), time.data() + time.size(), moment) - time.data());
  };
  // Each goes on where the one before it is still right: not at its end, behind which nothing has
  // changed yet, and where nothing is asked, so that it can lead there.
  constexpr double kLeading = 0.5;  // of the overlap
  for (Index first = 0; first < time.size();) {
    const double begin = time[first];
    const Index end = frameAt(begin + settings.window);
    Index behind = frameAt(begin + settings.window + settings.overlap);
    Index asked = frameAt(begin + settings.window + (1. - kLeading) * settings.overlap);
    if (time[time.size() - 1] - begin <= settings.window + 2. * settings.overlap ||
        time.size() - end < 4)
      behind = asked = time.size();
    if (is_mended)
      window.mend(first, behind, asked, change, q);
    else
      window.solve(first, behind, asked, change, q);
    if (behind == time.size()) return;
    change.middleCols(end, behind - end) = at_start.middleCols(end, behind - end);
    q.middleCols(end, behind - end) = start.middleCols(end, behind - end);
    first = std::max(end, first + 1);
  }
}

void summarize(const pinocchio::Model& model, RepairedMotion& found) {
  const auto root = found.change.topRows<3>().colwise().norm();
  found.root_rms = std::sqrt(root.squaredNorm() / double(found.change.cols()));
  found.root_largest = root.maxCoeff();
  const auto slides = internal::findSliding(model);
  double sum = 0.;
  Index joints = 0;
  for (Index row = 6; row < model.nv; ++row) {
    if (slides[row]) continue;
    ++joints;
    sum += found.change.row(row).squaredNorm() / double(found.change.cols());
    found.joint_largest =
        std::max(found.joint_largest, found.change.row(row).cwiseAbs().maxCoeff());
  }
  if (joints > 0) found.joint_rms = std::sqrt(sum / double(joints));
}

}  // namespace

RepairedMotion repairMotion(const PartRobot& parts, const Motion& motion,
                            const ContactSchedule& schedule, const RepairSettings& settings,
                            const Eigen::Array<bool, Eigen::Dynamic, 1>& free,
                            const RepairGround& ground, const Eigen::MatrixXd& start, bool anew) {
  settings.validate();
  const pinocchio::Model& model = parts.robot.getModel();
  const Index frames = motion.time.size();
  internal::requireTime(motion.time);
  internal::requireConfigurations(model, motion.q, frames);
  if (start.size() != 0) internal::requireConfigurations(model, start, frames);
  if (frames < 4) internal::throwInvalid("motion must have at least 4 frames, got ", frames);
  if (!internal::hasFreeFlyer(model))
    internal::throwInvalid("the root must be a free-flyer to be moved");
  if (free.size() != 0) internal::requireSize("free", free.size(), frames, "frames (or none)");
  if (ground.height.rows() != 0) {
    internal::requireSize("ground", ground.height.rows(), Index(parts.parts.size()), "parts");
    internal::requireSize("ground", ground.height.cols(), frames, "frames");
  }

  const internal::ContactSplit split = internal::describeSplit(parts);
  WholeBodyProblem problem = {
      model,
      listPoints(split),
      internal::listFriction(split),
      motion.time,
      motion.q,
      internal::listSets(parts.parts, schedule, frames),
      {},
      {},
      {},
      free,
      listCosts(model, settings.displacement, settings.turn),
      listCosts(model, settings.linear_acceleration, settings.angular_acceleration),
      {},
      settings.pinned_ends};
  if (settings.joints)
    problem.joints = internal::listLimits(model, settings.joint_margin, settings.speed_margin);
  if (free.size() == 0) problem.free.setConstant(frames, false);

  RepairedMotion found;
  found.change.setZero(model.nv, frames);
  found.stances = Footwork(split, problem, settings, ground).find();
  Eigen::MatrixXd q = motion.q;
  double worst = measure(problem, settings.feet ? ground.height : Eigen::MatrixXd(), q, found);
  measureJoints(problem, q, found);
  const bool are_joints_wrong =
      settings.joints && std::max(found.joint_excess, found.speed_excess) > 0.;
  if (worst > kReach || std::max(found.held_largest, found.sunk_largest) > kPlace ||
      are_joints_wrong) {
    const bool is_new = start.size() == 0;
    repairInWindows(problem, settings, is_new ? motion.q : start, !is_new && !anew, found.change,
                    q);
    worst = measure(problem, settings.feet ? ground.height : Eigen::MatrixXd(), q, found);
    measureJoints(problem, q, found);
  } else {
    for (RepairedStance& stance : found.stances) stance.is_still = false;
  }
  found.within_reach = worst <= kReach;
  found.residual *= split.carrier.mass * internal::findUnitGravity(split.carrier.gravity);
  found.motion = differentiate(model, motion.time, q);
  summarize(model, found);
  return found;
}

}  // namespace dynacom
