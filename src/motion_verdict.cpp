// SPDX-License-Identifier: BSD-2-Clause
#include "dynacom/motion_verdict.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <ostream>
#include <utility>

#include "check.hpp"
#include "motion_check.hpp"
#include "motion_judgement.hpp"
#include "motion_windows.hpp"
#include "nan.hpp"
#include "settings_fields.hpp"
#include "standard_gravity.hpp"
#include "support_meter.hpp"

namespace dynacom {

using internal::kNaN;
using internal::orInfinity;
using internal::requireField;
using internal::requireSize;
using internal::throwInvalid;

namespace {

using Mask = Eigen::Array<bool, Eigen::Dynamic, 1>;
using Vector6 = DynaCoM::Vector6;

// How many frames at either side of a jump are unsure at least: differences reach that far.
constexpr Eigen::Index kJumpFrames = 2;

// What is to be said of a fault, in the order of MotionFault.
struct Description {
  bool is_mendable;
  const char* code;
  FaultLimit VerdictSettings::*limit;
  const char* unit;
  const char* meaning;
};
constexpr Description kDescriptions[kMotionFaults] = {
    {false, "downward_normal", &VerdictSettings::downward_normal, "rad",
     "an active contact's normal points down, out of the robot"},
    {true, "residual_force", &VerdictSettings::residual_force, "m g",
     "the contacts cannot give the force"},
    {true, "residual_torque", &VerdictSettings::residual_torque, "m g m",
     "the contacts cannot give the moment"},
    {true, "cop_outside", &VerdictSettings::cop_outside, "m",
     "the centre of pressure is needed outside what carries"},
    {true, "flight_with_support_needed", &VerdictSettings::flight_with_support_needed, "m g",
     "no contact is active, but the motion needs support"},
    {true, "ground_penetration", &VerdictSettings::ground_penetration, "m",
     "a contact is below the ground"},
    {true, "foot_sliding", &VerdictSettings::foot_sliding, "m/s", "an active contact slides"},
    {false, "discontinuity", &VerdictSettings::discontinuity, "of the greatest speed",
     "the motion jumps"},
};

// What else settings have.
const internal::Fields<VerdictSettings>& numbers() {
  static const internal::Fields<VerdictSettings> all = {
      {"cop_force", &VerdictSettings::cop_force},
      {"linear_speed", &VerdictSettings::linear_speed},
      {"turning_speed", &VerdictSettings::turning_speed},
      {"joint_speed", &VerdictSettings::joint_speed},
      {"jump_time", &VerdictSettings::jump_time},
      {"minimal_window", &VerdictSettings::minimal_window},
      {"interruption", &VerdictSettings::interruption},
      {"repairable_distance", &VerdictSettings::repairable_distance},
      {"repairable_largest_distance", &VerdictSettings::repairable_largest_distance},
      {"repairable_depth", &VerdictSettings::repairable_depth},
      {"repairable_slide", &VerdictSettings::repairable_slide},
  };
  return all;
}

const Description& describe(MotionFault fault) {
  return kDescriptions[static_cast<std::size_t>(fault)];
}

// Whether accelerations decide it.
bool isOfForces(MotionFault fault) {
  return fault == MotionFault::ResidualForce || fault == MotionFault::ResidualTorque ||
         fault == MotionFault::CoPOutside || fault == MotionFault::FlightWithSupportNeeded;
}

// The height of the ground under contact k in a frame.
double groundAt(const Eigen::MatrixXd& ground, Eigen::Index k, Eigen::Index frame) {
  return ground(k, ground.cols() == 1 ? 0 : frame);
}

// How fast a contact moves along the ground in a frame.
double slidingSpeed(const ContactMotion& contact, Eigen::Index frame) {
  return orInfinity(contact.velocity.col(frame).head<2>().norm());
}

// @param unmeasured   how many frames do not count
// @param nameSubject  gives the finding's subject for the frame of the worst
template <class Function>
MotionFinding sumUp(Eigen::VectorXd measured, const FaultLimit& limit, const Eigen::VectorXd& time,
                    Eigen::Index unmeasured, Function nameSubject) {
  Eigen::Index frame = 0;
  const double worst = measured.maxCoeff(&frame);
  const Eigen::Index beyond = (measured.array() > limit.limit).count();
  const bool holds = double(beyond) > limit.allowed_share * double(time.size() - unmeasured);
  std::string subject = worst > 0. ? nameSubject(frame) : "";
  return {std::move(measured), beyond, worst, time[frame], holds, std::move(subject)};
}

// Where the normals of active contacts point: MotionVerdict::normals, and what is found of
// DownwardNormal.
void measureNormals(const internal::JudgedMotion& judged, const VerdictSettings& settings,
                    MotionVerdict& verdict) {
  const Eigen::VectorXd& time = judged.time;
  const std::vector<ContactMotion>& contacts = judged.faces;
  Eigen::VectorXd measured = Eigen::VectorXd::Zero(time.size());
  std::vector<std::size_t> whose(static_cast<std::size_t>(time.size()));
  for (std::size_t k = 0; k < contacts.size(); ++k) {
    double up = 0., downward = 0.;
    for (Eigen::Index frame = 0; frame < time.size(); ++frame) {
      if (!judged.active(Eigen::Index(k), frame)) continue;
      const auto rotation = contacts[k].rotation.col(frame);
      const double z = 1. - 2. * (rotation[0] * rotation[0] + rotation[1] * rotation[1]);
      up += z;
      if (z >= 0.) continue;
      ++downward;
      const double angle = orInfinity(std::asin(std::min(-z, 1.)));
      if (angle <= measured[frame]) continue;
      measured[frame] = angle;
      whose[static_cast<std::size_t>(frame)] = k;
    }
    const auto count = double(judged.active.row(Eigen::Index(k)).count());
    verdict.normals.push_back(count > 0. ? ContactNormal{up / count, downward / count}
                                         : ContactNormal{kNaN, kNaN});
  }
  constexpr MotionFault fault = MotionFault::DownwardNormal;
  verdict.findings[static_cast<std::size_t>(fault)] = sumUp(
      std::move(measured), settings[fault], time, 0,
      [&](Eigen::Index frame) { return contacts[whose[static_cast<std::size_t>(frame)]].name; });
}

// The longest way that is gone faster than a limit, of what is measured as a speed.
double findLongestWay(const MotionFinding& speed, double limit, const Eigen::VectorXd& time) {
  double longest = 0., way = 0.;
  for (Eigen::Index frame = 0; frame + 1 < time.size(); ++frame) {
    const bool is_fast = speed.measured[frame] > limit;
    way = is_fast ? way + speed.measured[frame] * (time[frame + 1] - time[frame]) : 0.;
    longest = std::max(longest, way);
  }
  return longest;
}

bool holdsAny(const MotionVerdict& verdict) {
  return std::any_of(verdict.findings.begin(), verdict.findings.end(),
                     [](const MotionFinding& finding) { return finding.holds; });
}

// Outcome and windows of what was found.
void conclude(const Eigen::VectorXd& time, const VerdictSettings& settings,
              MotionVerdict& verdict) {
  verdict.outcome = holdsAny(verdict) ? MotionOutcome::NotFeasible : MotionOutcome::Feasible;
  Mask beyond = Mask::Constant(time.size(), false);
  for (std::size_t k = 0; k < kMotionFaults; ++k)
    beyond = beyond ||
             verdict.findings[k].measured.array() > settings[static_cast<MotionFault>(k)].limit;
  const Mask jumped =
      verdict[MotionFault::Discontinuity].measured.array() > settings.discontinuity.limit;
  verdict.windows = internal::findWindows(time, beyond, jumped, verdict.unsure, settings);
  Eigen::Index inside = 0;
  for (const MotionWindow& window : verdict.windows) inside += window.last - window.first + 1;
  verdict.feasible_share = double(inside) / double(time.size());
}

bool isRecorded(const Motion& motion, const RecordedMotion& recorded) {
  const auto isSame = [](const Eigen::MatrixXd& one, const Eigen::MatrixXd& other) {
    return one.rows() == other.rows() && one.cols() == other.cols() && one == other;
  };
  return isSame(motion.v, recorded.v) && isSame(motion.a, recorded.a);
}

void requireFitting(const DynaCoM& robot, const Motion& motion, const RecordedMotion& recorded,
                    const std::vector<ContactMotion>& contacts, const Eigen::MatrixXd& ground,
                    const MotionAnalysis& analysis, const Mask& unsure) {
  const Eigen::Index frames = motion.frames();
  const auto count = static_cast<Eigen::Index>(contacts.size());
  internal::requireConfigurations(robot.getModel(), recorded.q, frames, "recorded.q");
  for (const Eigen::Matrix3Xd* values :
       {&analysis.ground_force, &analysis.ground_torque, &analysis.com})
    requireSize("analysis", values->cols(), frames, "frames");
  requireSize("analysis", analysis.residual.cols(), frames, "frames");
  requireSize("analysis", Eigen::Index(analysis.status.size()), frames, "frames");
  requireSize("ground", ground.rows(), count, "heights (one per contact)");
  if (ground.cols() != 1) requireSize("ground", ground.cols(), frames, "frames (or 1)");
  if (unsure.size() != 0) requireSize("unsure", unsure.size(), frames, "frames (or none)");
  const std::vector<std::string> names = robot.getKnownContacts();
  requireSize("contacts", contacts.size(), names.size(), "contacts of the robot");
  requireSize("analysis.contacts", analysis.contacts.size(), names.size(), "contacts of the robot");
  for (std::size_t k = 0; k < names.size(); ++k) {
    if (contacts[k].name != names[k] || analysis.contacts[k].name != names[k])
      throwInvalid("contacts must be those of the robot in its order: expected '", names[k],
                   "', got '", contacts[k].name, "' and '", analysis.contacts[k].name, "'");
    for (const Eigen::Index size : {contacts[k].height.size(), contacts[k].position.cols(),
                                    contacts[k].rotation.cols(), contacts[k].velocity.cols()})
      requireSize("contacts", size, frames, "frames");
    requireSize("analysis.contacts", analysis.contacts[k].active.size(), frames, "frames");
  }
}

}  // namespace

const char* to_string(MotionFault fault) { return describe(fault).code; }

const char* getUnit(MotionFault fault) { return describe(fault).unit; }

const char* getMeaning(MotionFault fault) { return describe(fault).meaning; }

bool isMendable(MotionFault fault) { return describe(fault).is_mendable; }

const char* to_string(MotionOutcome outcome) {
  switch (outcome) {
    case MotionOutcome::Feasible:
      return "feasible";
    case MotionOutcome::Repairable:
      return "repairable";
    case MotionOutcome::NotFeasible:
      return "not feasible";
    case MotionOutcome::Unknown:
      return "unknown";
  }
  return "unknown outcome";
}

const FaultLimit& VerdictSettings::operator[](MotionFault fault) const {
  return this->*describe(fault).limit;
}

FaultLimit& VerdictSettings::operator[](MotionFault fault) { return this->*describe(fault).limit; }

void VerdictSettings::validate() const {
  for (const Description& description : kDescriptions) {
    const FaultLimit& limit = this->*description.limit;
    const std::string field = std::string("VerdictSettings.") + description.code;
    requireField(std::isfinite(limit.limit) && limit.limit >= 0., (field + ".limit").c_str(),
                 "finite and >= 0", limit.limit);
    requireField(limit.allowed_share >= 0. && limit.allowed_share <= 1.,
                 (field + ".allowed_share").c_str(), "from 0 to 1", limit.allowed_share);
  }
  internal::requirePositive("VerdictSettings", *this, numbers(),
                            {&VerdictSettings::cop_force, &VerdictSettings::jump_time,
                             &VerdictSettings::minimal_window, &VerdictSettings::interruption});
}

std::string VerdictSettings::to_string() const { return internal::concat(*this); }

bool VerdictSettings::operator==(const VerdictSettings& other) const {
  return std::all_of(std::begin(kDescriptions), std::end(kDescriptions),
                     [&](const Description& description) {
                       return this->*description.limit == other.*description.limit;
                     }) &&
         internal::areEqual(*this, other, numbers());
}

std::ostream& operator<<(std::ostream& out, const VerdictSettings& settings) {
  out << "VerdictSettings(";
  for (const Description& description : kDescriptions) {
    const FaultLimit& limit = settings.*description.limit;
    out << description.code << "=(" << limit.limit << ", " << limit.allowed_share << "), ";
  }
  internal::write(out, settings, numbers());
  return out << ")";
}

const MotionFinding& MotionVerdict::operator[](MotionFault fault) const {
  return findings[static_cast<std::size_t>(fault)];
}

void MotionVerdict::weighDistance(const CentroidalChange& distance, const Eigen::VectorXd& time,
                                  const VerdictSettings& settings) {
  if (outcome != MotionOutcome::NotFeasible || !distance.converged) return;
  for (std::size_t k = 0; k < kMotionFaults; ++k)
    if (findings[k].holds && !isMendable(static_cast<MotionFault>(k))) return;
  const MotionFinding& sunk = (*this)[MotionFault::GroundPenetration];
  const MotionFinding& sliding = (*this)[MotionFault::FootSliding];
  if (sunk.holds && sunk.worst > settings.repairable_depth) return;
  if (sliding.holds &&
      findLongestWay(sliding, settings.foot_sliding.limit, time) > settings.repairable_slide)
    return;
  if (distance.rms <= settings.repairable_distance &&
      distance.largest <= settings.repairable_largest_distance)
    outcome = MotionOutcome::Repairable;
}

double MotionVerdict::getSeverity() const {
  Eigen::Index frames = 0;
  for (const MotionFinding& finding : findings)
    if (finding.holds) frames = std::max(frames, finding.frames);
  return frames > 0 ? double(frames) / double(unsure.size()) : 0.;
}

std::vector<std::string> MotionVerdict::getCodes() const {
  if (outcome == MotionOutcome::Unknown) return {"too_short"};
  std::vector<std::string> codes;
  for (std::size_t k = 0; k < kMotionFaults; ++k)
    if (findings[k].holds) codes.emplace_back(kDescriptions[k].code);
  if (codes.empty()) codes.emplace_back("feasible");
  return codes;
}

Mask internal::findNearJumps(const Eigen::VectorXd& time, const StepSpeeds& steps,
                             const VerdictSettings& settings) {
  const Eigen::Index frames = time.size();
  Mask near_jumps = Mask::Constant(frames, false);
  for (Eigen::Index step = 0; step < steps.speed.size(); ++step) {
    if (!(steps.speed[step] > settings.discontinuity.limit)) continue;
    Eigen::Index first = std::max<Eigen::Index>(step - kJumpFrames, 0);
    Eigen::Index last = std::min(step + 1 + kJumpFrames, frames - 1);
    while (first > 0 && time[step] - time[first - 1] <= settings.jump_time) --first;
    while (last < frames - 1 && time[last + 1] - time[step + 1] <= settings.jump_time) ++last;
    near_jumps.segment(first, last - first + 1).setConstant(true);
  }
  return near_jumps;
}

bool internal::isTooShort(const Motion& motion, const RecordedMotion& recorded) {
  return motion.frames() < kMinimalFrames && !isRecorded(motion, recorded);
}

MotionVerdict judgeMotion(const DynaCoM& robot, const Motion& motion,
                          const RecordedMotion& recorded,
                          const std::vector<ContactMotion>& contacts, const Eigen::MatrixXd& ground,
                          const MotionAnalysis& analysis, const VerdictSettings& settings,
                          int threads, const Mask& unsure) {
  requireField(threads >= 0, "threads", ">= 0", threads);
  if (!robot.isInitialized())
    throw NotReadyError("DynaCoM is used by judgeMotion before initialize()");
  settings.validate();
  motion.validate(robot.getModel());
  requireFitting(robot, motion, recorded, contacts, ground, analysis, unsure);
  const internal::Carrier carrier = internal::describeCarrier(robot);
  const internal::StepSpeeds steps =
      internal::measureStepSpeeds(robot.getModel(), motion.time, recorded.q, settings);
  Mask near_jumps = internal::findNearJumps(motion.time, steps, settings);
  Mask all_unsure = near_jumps;
  if (unsure.size() != 0) all_unsure = all_unsure || unsure;
  ContactSchedule::Matrix active(Eigen::Index(contacts.size()), motion.frames());
  for (std::size_t k = 0; k < contacts.size(); ++k)
    active.row(Eigen::Index(k)) = analysis.contacts[k].active.transpose();
  internal::Workers workers(threads);
  return internal::judgeMotion(
      {carrier, motion.time, steps, contacts, ground, analysis, contacts, active,
       std::move(near_jumps), std::move(all_unsure), internal::isTooShort(motion, recorded)},
      settings, workers);
}

MotionVerdict internal::judgeMotion(const JudgedMotion& judged, const VerdictSettings& settings,
                                    Workers& workers) {
  const Eigen::VectorXd& time = judged.time;
  const std::vector<ContactMotion>& contacts = judged.contacts;
  const MotionAnalysis& analysis = judged.analysis;
  const Eigen::Index frames = time.size();
  MotionVerdict verdict = {};
  verdict.unsure = judged.unsure;

  const double weight = judged.carrier.mass * internal::findUnitGravity(judged.carrier.gravity);
  std::array<Eigen::VectorXd, kMotionFaults> measured;
  for (Eigen::VectorXd& values : measured) values.setZero(frames);
  const auto measure = [&](MotionFault fault) -> Eigen::VectorXd& {
    return measured[static_cast<std::size_t>(fault)];
  };
  // What the motion needs and its contacts cannot give.
  const auto judgeForces = [&](Eigen::Index frame, bool flies, SupportMeter& support) {
    const auto residual = analysis.residual.col(frame);
    const double force = orInfinity(residual.head<3>().norm() / weight);
    const double torque = orInfinity(residual.tail<3>().norm() / weight);
    if (flies) {
      measure(MotionFault::FlightWithSupportNeeded)[frame] = std::max(force, torque);
      return;
    }
    measure(MotionFault::ResidualForce)[frame] = force;
    measure(MotionFault::ResidualTorque)[frame] = torque;
    const bool is_loaded = !(analysis.ground_force(2, frame) < settings.cop_force * weight);
    if (is_loaded && analysis.status[static_cast<std::size_t>(frame)] != DistributionStatus::Solved)
      measure(MotionFault::CoPOutside)[frame] =
          support.measure(frame, [&](std::size_t k) { return analysis.contacts[k].active[frame]; });
  };
  // How far a contact is below its ground; not a number where there is none.
  const auto findDepth = [&](Eigen::Index k, Eigen::Index frame) {
    const double ground = groundAt(judged.ground, k, frame);
    if (std::isnan(ground)) return kNaN;
    return orInfinity(ground - contacts[static_cast<std::size_t>(k)].height[frame]);
  };
  forEachBlock(workers, frames, [&]() -> BlockWork {
    return [&, support = SupportMeter(judged.carrier, contacts, analysis)](
               Eigen::Index first, Eigen::Index size) mutable {
      for (Eigen::Index frame = first; frame < first + size; ++frame) {
        double& depth = measure(MotionFault::GroundPenetration)[frame];
        double& sliding = measure(MotionFault::FootSliding)[frame];
        bool flies = true;
        for (std::size_t k = 0; k < contacts.size(); ++k) {
          depth = std::fmax(depth, findDepth(Eigen::Index(k), frame));
          if (!analysis.contacts[k].active[frame]) continue;
          flies = false;
          if (!judged.near_jumps[frame])
            sliding = std::max(sliding, slidingSpeed(contacts[k], frame));
        }
        if (!verdict.unsure[frame]) judgeForces(frame, flies, support);
      }
    };
  });
  Eigen::VectorXd& jumps = measure(MotionFault::Discontinuity);
  for (Eigen::Index step = 0; step < judged.steps.speed.size(); ++step)
    for (const Eigen::Index frame : {step, step + 1})
      jumps[frame] = std::max(jumps[frame], judged.steps.speed[step]);

  // The first contact of which a frame's value is.
  const auto nameContact = [&](auto isIt) -> std::string {
    for (std::size_t k = 0; k < contacts.size(); ++k)
      if (isIt(k)) return contacts[k].name;
    return "";
  };
  const Eigen::Index unsure = verdict.unsure.count();
  for (std::size_t k = 0; k < kMotionFaults; ++k) {
    const auto fault = static_cast<MotionFault>(k);
    if (fault == MotionFault::DownwardNormal) continue;
    Eigen::Index unmeasured = isOfForces(fault) ? unsure : 0;
    if (fault == MotionFault::FootSliding) unmeasured = judged.near_jumps.count();
    verdict.findings[k] = sumUp(
        measured[k], settings[fault], time, unmeasured, [&](Eigen::Index frame) -> std::string {
          const double worst = measured[k][frame];
          if (fault == MotionFault::Discontinuity) return judged.steps.fastest;
          if (fault == MotionFault::GroundPenetration)
            return nameContact(
                [&](std::size_t i) { return findDepth(Eigen::Index(i), frame) == worst; });
          if (fault == MotionFault::FootSliding)
            return nameContact([&](std::size_t i) {
              return analysis.contacts[i].active[frame] &&
                     slidingSpeed(contacts[i], frame) == worst;
            });
          return "";
        });
  }
  measureNormals(judged, settings, verdict);
  const bool is_known = frames - unsure >= std::min(kMinimalFrames, frames);
  if (judged.is_too_short || (!holdsAny(verdict) && !is_known))
    verdict.outcome = MotionOutcome::Unknown;
  else
    conclude(time, settings, verdict);
  return verdict;
}

}  // namespace dynacom
