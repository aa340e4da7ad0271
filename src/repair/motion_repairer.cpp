// SPDX-License-Identifier: BSD-2-Clause
#include "dynacom/motion_repairer.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <optional>
#include <pinocchio/algorithm/joint-configuration.hpp>
#include <utility>

#include "../check.hpp"
#include "../motion_check.hpp"
#include "../nan.hpp"
#include "foot_measures.hpp"
#include "joint_limits.hpp"
#include "motion_linearization.hpp"

namespace dynacom {

using Eigen::Index;

void RepairerSettings::validate() const {
  examination.validate();
  repair.validate();
  internal::requireField(rounds >= 1, "RepairerSettings.rounds", ">= 1", rounds);
  for (const auto& [name, value] : {std::pair("largest_displacement", largest_displacement),
                                    std::pair("largest_turn", largest_turn)})
    internal::requireField(std::isfinite(value) && value > 0.,
                           internal::concat("RepairerSettings.", name).c_str(), "finite and > 0",
                           value);
  internal::requireField(std::isfinite(largest_stretch) && largest_stretch >= 1.,
                         "RepairerSettings.largest_stretch", "finite and >= 1", largest_stretch);
}

const char* to_string(RepairOutcome outcome) {
  switch (outcome) {
    case RepairOutcome::Feasible:
      return "feasible";
    case RepairOutcome::Repaired:
      return "repaired";
    case RepairOutcome::NotRepaired:
      break;
  }
  return "not repaired";
}

const char* to_string(RepairRung rung) {
  constexpr const char* kNames[] = {"ground", "filter", "schedule", "balance",
                                    "feet",   "joints", "time"};
  return kNames[static_cast<std::size_t>(rung)];
}

namespace {

// Contacts may lack so much of what is needed in a frame [m g], [m g m].
constexpr double kGiven = 1e-3;
// Contacts of an exact motion count if they leave it no farther from a feasible one than so many
// times, and so much more [m], than those of a noisy one.
constexpr double kFarther = 1.5, kFartherBy = 0.003;
// Joints that are no farther beyond their limits are within them: so much comes of rounding.
constexpr double kWithinLimits = 1e-9;
// Where limits are not looked after, so much counts as nothing [rad], [m]: a gripper that is at its
// limit goes beyond it with any change.
constexpr double kNearLimits = 1e-3;
// A motion whose joints are accelerated so many times as much as before, and as one that is calm
// [rad/s²], RMS, is worse.
constexpr double kWilder = 3., kCalm = 3.;
// What stands no farther from where it is to be is there [m].
constexpr double kSamePlace = 1e-3;
// By which factors time is stretched.
constexpr double kStretches[] = {1.1, 1.25, 1.5, 2., 3., 4.};

bool isSolved(const MotionExamination& found, Index frame) {
  const DistributionStatus status = found.analysis.status[static_cast<std::size_t>(frame)];
  return status == DistributionStatus::Solved || found.verdict.unsure[frame];
}

bool isMissing(const MotionExamination& found, Index frame) {
  if (isSolved(found, frame)) return false;
  return !(found.analysis.residual.col(frame).norm() <= kGiven * found.statistics.weight);
}

Index countMissing(const MotionExamination& found) {
  Index count = 0;
  for (Index frame = 0; frame < found.analysis.time.size(); ++frame)
    count += isMissing(found, frame);
  return count;
}

// Frames that are judged and not Solved, however little is missing.
std::vector<Index> listUnsolved(const MotionExamination& found) {
  std::vector<Index> unsolved;
  for (Index frame = 0; frame < found.analysis.time.size(); ++frame)
    if (!isSolved(found, frame)) unsolved.push_back(frame);
  return unsolved;
}

// Turns a motion about the origin such that a slope becomes level.
// @return  by how much [rad]
double level(const Eigen::Vector2d& slope, Eigen::MatrixXd& q) {
  if (slope.isZero(0.)) return 0.;
  const auto turn = Eigen::Quaterniond::FromTwoVectors(Eigen::Vector3d(-slope.x(), -slope.y(), 1.),
                                                       Eigen::Vector3d::UnitZ());
  for (Index frame = 0; frame < q.cols(); ++frame) {
    auto root = q.col(frame).head<7>();
    root.head<3>() = turn * Eigen::Vector3d(root.head<3>());
    root.tail<4>() = (turn * Eigen::Quaterniond(Eigen::Vector4d(root.tail<4>()))).coeffs();
  }
  return std::atan(slope.norm());
}

// Of a motion, what counts against others.
struct Standing {
  Index missing;   // frames
  Index unsolved;  // frames in which anything is missing
  double lack;     // of forces [m g] and moments [m g m], RMS
  int rank;        // of its verdict, the higher the better
  bool is_carried;
  double jolt;    // accelerations of joints, RMS
  double slide;   // of contacts [m/s]
  double excess;  // of joints, see findLargestExcess()

  bool isFeasible() const { return rank == 2; }
};

Standing judge(const pinocchio::Model& model, const MotionExamination& found) {
  const MotionStatistics& statistics = found.statistics;
  const auto joints = found.derived.motion.a.bottomRows(found.derived.motion.a.rows() - 6);
  const MotionOutcome outcome = found.verdict.outcome;
  return {
      countMissing(found),
      Index(listUnsolved(found).size()),
      std::hypot(statistics.residual_force_rms, statistics.residual_torque_rms),
      outcome == MotionOutcome::Feasible     ? 2
      : outcome == MotionOutcome::Repairable ? 1
                                             : 0,
      found.inference.schedule.active.any(),
      joints.size() == 0 ? 0. : std::sqrt(joints.squaredNorm() / double(joints.size())),
      found.verdict[MotionFault::FootSliding].worst,
      internal::findLargestExcess(model, found.derived.motion.time, found.derived.motion.q).size};
}

RepairChange summarize(const Eigen::RowVectorXd& sizes) {
  RepairChange change;
  change.rms = std::sqrt(sizes.squaredNorm() / double(sizes.size()));
  change.largest = sizes.maxCoeff(&change.frame);
  return change;
}

RepairChange summarizeJoints(const pinocchio::Model& model, const Eigen::MatrixXd& change) {
  const auto slides = internal::findSliding(model);
  RepairChange joints;
  double sum = 0.;
  Index count = 0;
  for (pinocchio::JointIndex joint = 2; joint < pinocchio::JointIndex(model.njoints); ++joint)
    for (Index row = model.idx_vs[joint]; row < model.idx_vs[joint] + model.nvs[joint]; ++row) {
      if (slides[row]) continue;
      ++count;
      const RepairChange own = summarize(change.row(row).cwiseAbs());
      sum += own.rms * own.rms;
      if (own.largest <= joints.largest) continue;
      joints.largest = own.largest;
      joints.frame = own.frame;
      joints.joint = model.names[joint];
    }
  if (count > 0) joints.rms = std::sqrt(sum / double(count));
  return joints;
}

}  // namespace

struct MotionRepairer::Workspace {
  Workspace(const DynaCoM& given, const RepairerSettings& given_settings)
      : robot(given),
        settings(given_settings),
        recorded(robot, settings.examination),
        plain(robot, makePlain(settings.examination, settings.examination.cutoff)),
        exact(robot, makePlain(settings.examination, 0.)) {
    if (std::isnan(settings.examination.detection.ground_height)) return;
    ExaminationSettings found = plain.getSettings();
    found.detection.ground_height = internal::kNaN;
    anywhere.emplace(robot, found);
  }

  static ExaminationSettings makePlain(ExaminationSettings settings, double cutoff) {
    settings.cutoff = cutoff;
    settings.sensitivity = false;
    settings.progress = nullptr;
    settings.distance = true;
    return settings;
  }

  // Whether nothing is to be done, or can be.
  bool isLeft(const MotionExamination& found) const {
    return found.verdict.outcome == MotionOutcome::Unknown ||
           (found.verdict.isFeasible() && !(settings.strict && countMissing(found) > 0));
  }

  const DynaCoM robot;
  const RepairerSettings settings;
  const MotionExaminer recorded, plain, exact;
  std::optional<MotionExaminer> anywhere;  // the ground, if it is told where it is

  class Ladder;
};

// One motion, at one pace.
class MotionRepairer::Workspace::Ladder {
 public:
  Ladder(const Workspace& workspace, const RecordedMotion& recorded, MotionExamination before)
      : workspace_(workspace), settings_(workspace.settings), recorded_(recorded) {
    found_.before = std::move(before);
    before_ = judge(model(), found_.before);
    found_.missing_before = before_.missing;
  }

  // Of a motion that stays as it was.
  MotionRepair leave() {
    found_.recorded = recorded_;
    found_.after = found_.filtered = found_.before;
    found_.change.setZero(model().nv, recorded_.time.size());
    found_.missing = found_.missing_before;
    found_.outcome = RepairOutcome::Feasible;
    if (found_.before.verdict.outcome == MotionOutcome::Unknown) {
      found_.outcome = RepairOutcome::NotRepaired;
      found_.reasons.push_back(
          {"too_short", internal::kNaN, "there are too few frames whose accelerations are known"});
    }
    found_.joint_excess_before = found_.joint_excess = findExcess(recorded_.q);
    found_.feet_before = found_.feet =
        internal::measureFeet(found_.before, found_.before, found_.stances);
    return std::move(found_);
  }

  MotionRepair climb() {
    const Motion& origin = found_.before.derived.motion;
    if (found_.before.derived.cutoff > 0.) {
      const RepairChange moved = summarize((origin.q - recorded_.q).topRows<3>().colwise().norm());
      found_.steps.push_back({RepairRung::Filter, 0., moved.rms, true});
    }
    const Contacts contacts = findContacts();
    std::optional<Attempt> best = balance(contacts);
    standAndLimit(contacts, best);
    if (!best) return giveUp();
    finish(std::move(*best));
    return std::move(found_);
  }

 private:
  // Those that a motion is repaired with.
  struct Contacts {
    std::vector<BodyPoints> links;
    ContactInference inference;
  };

  // What repairMotion() found, and what is kept of how that is judged, as an exact motion.
  struct Attempt {
    Eigen::MatrixXd q, change;
    std::vector<RepairedStance> stances;
    std::vector<double> drifts;  // of these [m]
    Contacts contacts;
    std::vector<Index> unsolved;  // frames
    Standing standing;
  };

  const pinocchio::Model& model() const { return workspace_.robot.getModel(); }

  RecordedMotion write(const Eigen::MatrixXd& q) const {
    return {recorded_.time, q, {}, {}, recorded_.schedule, true};
  }

  // As it was, since all that was tried is worse.
  MotionRepair giveUp() {
    found_ = leave();
    found_.outcome = RepairOutcome::NotRepaired;
    explain();
    found_.reasons.push_back({"not_better", internal::kNaN,
                              "what was tried is worse than the motion as it was, which is kept"});
    return std::move(found_);
  }

  // Those of the same motion taken for exact, if they do not make it much harder.
  Contacts findContacts() {
    const auto of = [](const MotionExamination& found) -> Contacts {
      return {found.links, found.inference};
    };
    if (found_.before.derived.isExact()) return of(found_.before);
    const MotionExamination exact = workspace_.exact.examine(write(found_.before.derived.motion.q));
    const auto distanceOf = [](const MotionExamination& found) {
      return found.distance && found.distance->converged ? found.distance->rms : internal::kNaN;
    };
    const double before = distanceOf(found_.before), after = distanceOf(exact);
    const bool is_kept = after <= kFarther * before + kFartherBy;
    found_.steps.push_back({RepairRung::Schedule, before, after, is_kept});
    return of(is_kept ? exact : found_.before);
  }

  // Wrenches alone; nothing where that makes the motion worse.
  std::optional<Attempt> balance(const Contacts& contacts) {
    RepairSettings settings = settings_.repair;
    settings.feet = settings.joints = false;
    Attempt attempt = repeat(settings, contacts, found_.before.derived.motion.q);
    const bool is_kept = !isWorse(attempt.standing, before_);
    found_.steps.push_back(
        {RepairRung::Balance, double(before_.missing), double(attempt.standing.missing), is_kept});
    if (!is_kept) return std::nullopt;
    return attempt;
  }

  // Feet and joints, as far as something is wrong with them: both at once, since legs that reach
  // for a place may have to bend beyond their limits. Where feet cannot be held, joints alone.
  void standAndLimit(const Contacts& contacts, std::optional<Attempt>& best) {
    const Standing below = best ? best->standing : before_;
    const bool are_limits_wrong = settings_.repair.joints && below.excess > kWithinLimits;
    const bool are_feet_wrong = settings_.repair.feet && !(best && best->standing.isFeasible() &&
                                                           listSlipping(*best).empty());
    if (best && !are_limits_wrong && !are_feet_wrong) return;
    if (settings_.repair.feet && goOn(settings_.repair, contacts, below, best)) return;
    if (!settings_.repair.joints || (best && !are_limits_wrong)) return;
    RepairSettings settings = settings_.repair;
    settings.feet = false;
    goOn(settings, contacts, below, best);
  }

  // From the rung below, if no wrench is lost for it, and joints that were to come nearer to their
  // limits do.
  // Where balance alone has not led to where contacts are found again, feet that are level may.
  bool goOn(const RepairSettings& settings, const Contacts& contacts, const Standing& below,
            std::optional<Attempt>& best) {
    const bool is_balanced = best && below.missing == 0;
    Attempt attempt = is_balanced ? repeat(settings, best->contacts, best->q)
                                  : repeat(settings, contacts, found_.before.derived.motion.q);
    const Standing found = attempt.standing;
    const bool are_limits_better =
        found.excess <= kWithinLimits || found.excess < below.excess - kWithinLimits;
    const bool is_kept = isSmall(attempt.change) && !isWorse(found, below) &&
                         (!settings.joints || are_limits_better);
    if (settings.feet)
      found_.steps.push_back({RepairRung::Feet, below.slide, found.slide, is_kept});
    if (settings.joints && (is_kept || !settings.feet))
      found_.steps.push_back({RepairRung::Joints, below.excess, found.excess, is_kept});
    if (is_kept) best = std::move(attempt);
    return is_kept;
  }

  // Stances of contacts that drift by more than they may and be held.
  std::vector<std::size_t> listSlipping(const Attempt& attempt) const {
    std::vector<std::size_t> slipping;
    for (std::size_t k = 0; k < attempt.stances.size(); ++k)
      if (isOfContact(attempt.stances[k]) && attempt.drifts[k] > settings_.repair.largest_drift)
        slipping.push_back(k);
    return slipping;
  }

  // Not of another link.
  bool isOfContact(const RepairedStance& stance) const {
    return stance.contact < found_.before.contacts.size();
  }

  // Whether something is lost against another motion: wrenches, the verdict, all contacts, or what
  // was smooth.
  bool isWorse(const Standing& found, const Standing& other) const {
    return found.missing > other.missing || found.lack > other.lack + kGiven ||
           found.rank < other.rank || (other.is_carried && !found.is_carried) ||
           found.jolt > kWilder * (before_.jolt + kCalm);
  }

  double findExcess(const Eigen::MatrixXd& q) const {
    return internal::findLargestExcess(model(), recorded_.time, q).size;
  }

  bool isSmall(const Eigen::MatrixXd& change) const {
    return change.topRows<3>().colwise().norm().maxCoeff() <= settings_.largest_displacement &&
           summarizeJoints(model(), change).largest <= settings_.largest_turn;
  }

  // Repairs with the contacts that were found. Where these are others then, and cannot give what is
  // needed, it does so once more with those, near such frames, and so on.
  Attempt repeat(const RepairSettings& settings, const Contacts& contacts,
                 const Eigen::MatrixXd& start) const {
    ContactSchedule schedule = contacts.inference.schedule;
    Attempt best = tryWith(settings, contacts, schedule, start, true);
    std::optional<Attempt> worse;  // the last, if it is
    for (int round = 1; round < settings_.rounds; ++round) {
      const Attempt& last = worse ? *worse : best;
      if (last.unsolved.empty() && (!settings.feet || last.standing.isFeasible())) break;
      adopt(last, schedule);
      Attempt next = tryWith(settings, last.contacts, schedule, last.q, false);
      if (isBetter(next.standing, best.standing)) {
        best = std::move(next);
        worse.reset();
      } else {
        worse = std::move(next);
      }
    }
    return best;
  }

  // @param schedule  of contacts that may be others than those that were found
  // @param is_new    whether costs count, or frames are mended only that are out of reach
  Attempt tryWith(const RepairSettings& settings, const Contacts& contacts,
                  const ContactSchedule& schedule, const Eigen::MatrixXd& start,
                  bool is_new) const {
    const PartRobot parts =
        splitContacts(workspace_.robot, contacts.links, settings_.examination.friction);
    RepairGround ground;
    if (settings.feet) ground = findRepairGround(parts.parts, contacts.inference, recorded_.time);
    RepairedMotion repaired = repairMotion(parts, found_.before.derived.motion, schedule, settings,
                                           {}, ground, start, is_new);
    const MotionExamination found = workspace_.exact.examine(write(repaired.motion.q));
    std::vector<double> drifts = internal::measureDrifts(found, found, repaired.stances);
    return {std::move(repaired.motion.q),   std::move(repaired.change),
            std::move(repaired.stances),    std::move(drifts),
            {found.links, found.inference}, listUnsolved(found),
            judge(model(), found)};
  }

  // Takes contacts that were found around frames in which they cannot give what is needed; all of
  // them, where they are others.
  static void adopt(const Attempt& found, ContactSchedule& schedule) {
    constexpr Index kAround = 3;
    const ContactSchedule& other = found.contacts.inference.schedule;
    if (schedule.names != other.names) {
      schedule = other;
      return;
    }
    const Index frames = schedule.active.cols();
    for (const Index frame : found.unsolved) {
      const Index first = std::max<Index>(frame - kAround, 0);
      const Index count = std::min(frame + kAround + 1, frames) - first;
      schedule.active.middleCols(first, count) = other.active.middleCols(first, count);
    }
  }

  static bool isBetter(const Standing& one, const Standing& other) {
    if (one.missing != other.missing) return one.missing < other.missing;
    return one.rank != other.rank ? one.rank > other.rank : one.unsolved < other.unsolved;
  }

  void finish(Attempt attempt) {
    found_.recorded = write(attempt.q);
    found_.after = workspace_.exact.examine(found_.recorded);
    found_.missing = attempt.standing.missing;
    found_.feet_before = internal::measureFeet(found_.before, found_.after, attempt.stances);
    found_.feet = internal::measureFeet(found_.after, found_.after, attempt.stances);
    found_.change = std::move(attempt.change);
    found_.root = summarize(found_.change.topRows<3>().colwise().norm());
    found_.joints = summarizeJoints(model(), found_.change);
    found_.turn = summarize(found_.change.middleRows<3>(3).colwise().norm());
    found_.joint_excess_before = findExcess(found_.before.derived.motion.q);
    found_.joint_excess = findExcess(found_.recorded.q);
    found_.com =
        summarize((found_.after.analysis.com - found_.before.analysis.com).colwise().norm());
    RecordedMotion unmarked = found_.recorded;
    unmarked.is_exact = false;
    found_.filtered = workspace_.plain.examine(unmarked);
    explain();
    explainFeet(attempt);
    found_.stances = std::move(attempt.stances);
    found_.outcome = found_.reasons.empty() ? RepairOutcome::Repaired : RepairOutcome::NotRepaired;
  }

  void explain() {
    explainMissing();
    for (std::size_t k = 0; k < kMotionFaults; ++k) {
      const auto fault = static_cast<MotionFault>(k);
      const MotionFinding& finding = found_.after.verdict[fault];
      if (!finding.holds) continue;
      std::string text =
          internal::concat(getMeaning(fault), ": up to ", finding.worst, " ", getUnit(fault));
      if (!finding.subject.empty()) text += " (" + finding.subject + ")";
      found_.reasons.push_back({to_string(fault), finding.time, text});
    }
    explainLimits();
    if (!isSmall(found_.change))
      found_.reasons.push_back(
          {"bound", recorded_.time[found_.root.frame],
           internal::concat("the root has to be displaced by up to ", found_.root.largest,
                            " m, and ", found_.joints.joint, " turned by up to ",
                            found_.joints.largest, " rad: settings allow ",
                            settings_.largest_displacement, " m and ", settings_.largest_turn,
                            " rad")});
  }

  // Also where nobody asked for them.
  void explainLimits() {
    if (!(found_.joint_excess > (settings_.repair.joints ? kWithinLimits : kNearLimits))) return;
    const internal::LargestExcess largest =
        internal::findLargestExcess(model(), recorded_.time, found_.recorded.q);
    const auto& joints = model().idx_vs;
    const auto joint = std::find(joints.begin() + 1, joints.end(), int(largest.v)) - joints.begin();
    found_.reasons.push_back(
        {"joint_limits", recorded_.time[largest.frame],
         internal::concat(model().names[std::size_t(joint)], " is beyond its limits, by up to ",
                          largest.size,
                          internal::findSliding(model())[largest.v] ? " m" : " rad")});
  }

  // Contacts that were to stand still, and drift.
  void explainFeet(const Attempt& attempt) {
    if (!settings_.repair.feet) return;
    const std::vector<std::size_t> slipping = listSlipping(attempt);
    if (slipping.empty()) return;
    const std::size_t worst = *std::max_element(
        slipping.begin(), slipping.end(), [&](std::size_t one, std::size_t other) {
          return attempt.drifts[one] < attempt.drifts[other];
        });
    const auto count =
        std::count_if(attempt.stances.begin(), attempt.stances.end(),
                      [&](const RepairedStance& stance) { return isOfContact(stance); });
    found_.reasons.push_back(
        {"feet_not_held", recorded_.time[attempt.stances[worst].first],
         internal::concat("feet cannot be held in ", slipping.size(), " of ", count,
                          " stances: they drift by up to ", attempt.drifts[worst], " m")});
  }

  // Frames whose wrench is still out of reach, where something carries, and where nothing does.
  void explainMissing() {
    const MotionExamination& found = found_.after;
    for (const bool is_flight : {true, false}) {
      Index count = 0, worst = 0;
      double largest = 0.;
      for (Index frame = 0; frame < recorded_.time.size(); ++frame) {
        if (!isMissing(found, frame) ||
            found.inference.schedule.active.col(frame).any() == is_flight)
          continue;
        ++count;
        const double size = found.analysis.residual.col(frame).norm() / found.statistics.weight;
        if (size <= largest) continue;
        largest = size;
        worst = frame;
      }
      if (count == 0) continue;
      const bool is_end = is_flight && (worst == 0 || worst == recorded_.time.size() - 1);
      found_.reasons.push_back(
          {is_flight ? "contact_needed" : "out_of_reach", recorded_.time[worst],
           internal::concat(is_flight ? "nothing carries, and something would have to"
                                      : "what carries cannot give what is needed",
                            ", in ", count, " frames", is_end ? ", at an end of the clip" : "",
                            ": ", largest, " m g are missing")});
    }
  }

  const Workspace& workspace_;
  const RepairerSettings& settings_;
  const RecordedMotion& recorded_;
  MotionRepair found_ = {};
  Standing before_ = {};
};

MotionRepairer::MotionRepairer(const DynaCoM& robot, const RepairerSettings& settings) {
  settings.validate();
  if (!internal::hasFreeFlyer(robot.getModel()))
    internal::throwInvalid("the robot's root must be a free-flyer to be moved");
  workspace_ = std::make_unique<Workspace>(robot, settings);
}

MotionRepairer::~MotionRepairer() = default;
MotionRepairer::MotionRepairer(MotionRepairer&&) noexcept = default;
MotionRepairer& MotionRepairer::operator=(MotionRepairer&&) noexcept = default;

const RepairerSettings& MotionRepairer::getSettings() const { return workspace_->settings; }

MotionRepair MotionRepairer::repair(const RecordedMotion& recorded) const {
  const Workspace& workspace = *workspace_;
  MotionExamination before = workspace.recorded.examine(recorded);
  RecordedMotion other = {recorded.time, recorded.q, {}, {}, recorded.schedule, recorded.is_exact};
  // Another rung before all others, if that leads to the end.
  const auto climbAfter = [&](RepairStep step) {
    std::optional<MotionRepair> climbed =
        Workspace::Ladder(workspace, other, workspace.plain.examine(other)).climb();
    if (climbed->outcome != RepairOutcome::Repaired)
      climbed.reset();
    else
      climbed->steps.insert(climbed->steps.begin(), step);
    return climbed;
  };
  const auto goOnFrom = [](MotionRepair climbed, MotionExamination first) {
    climbed.before = std::move(first);
    climbed.missing_before = countMissing(climbed.before);
    return climbed;
  };
  if (workspace.isLeft(before)) return Workspace::Ladder(workspace, recorded, before).leave();
  if (workspace.anywhere) {
    MotionExamination anywhere = workspace.anywhere->examine(other);
    const double tilt = level(anywhere.inference.slope, other.q);
    if (tilt > 0.) anywhere = workspace.anywhere->examine(other);
    const double height = anywhere.terrain.level;
    const double ground = workspace.settings.examination.detection.ground_height;
    other.q.row(2).array() += ground - height;
    if (tilt > 0. || std::abs(height - ground) > kSamePlace)
      if (auto found = climbAfter({RepairRung::Ground, height - ground, 0., true})) {
        found->ground_offset = ground - height;
        found->ground_tilt = tilt;
        return goOnFrom(std::move(*found), std::move(before));
      }
    other.q = recorded.q;
  }
  MotionRepair found = Workspace::Ladder(workspace, recorded, std::move(before)).climb();
  for (const double factor : kStretches) {
    if (found.outcome != RepairOutcome::NotRepaired || factor > workspace.settings.largest_stretch)
      break;
    other.time = recorded.time[0] + factor * (recorded.time.array() - recorded.time[0]);
    if (auto slower = climbAfter({RepairRung::Time, 1., factor, true})) {
      slower->stretch = factor;
      return goOnFrom(std::move(*slower), std::move(found.before));
    }
  }
  return found;
}

MotionRepair repairRecordedMotion(const DynaCoM& robot, const RecordedMotion& recorded,
                                  const RepairerSettings& settings) {
  return MotionRepairer(robot, settings).repair(recorded);
}

}  // namespace dynacom
