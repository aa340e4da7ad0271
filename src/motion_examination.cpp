// SPDX-License-Identifier: BSD-2-Clause
#include "dynacom/motion_examination.hpp"

#include <algorithm>
#include <cmath>
#include <exception>
#include <iterator>
#include <memory>
#include <mutex>
#include <utility>

#include "body_screening.hpp"
#include "check.hpp"
#include "contact_split.hpp"
#include "dynacom/contact_point.hpp"
#include "inference/cone_projection.hpp"
#include "inference/contact_inference.hpp"
#include "motion_derivation.hpp"
#include "motion_distribution.hpp"
#include "motion_judgement.hpp"
#include "motion_sweep.hpp"
#include "nan.hpp"
#include "repair/centroidal_filter.hpp"
#include "seat_search.hpp"
#include "standard_gravity.hpp"
#include "support_meter.hpp"

namespace dynacom {

void ExaminationSettings::validate() const {
  internal::requireField(std::isnan(cutoff) || (cutoff >= 0. && std::isfinite(cutoff)),
                         "ExaminationSettings.cutoff", "finite and >= 0 Hz, or NaN", cutoff);
  analysis.validate();
  filter.validate();
  detection.validate();
  verdict.validate();
}

namespace {

using internal::ContactSplit;
using Mask = Eigen::Array<bool, Eigen::Dynamic, 1>;

// The ground under each contact's lowest part.
Eigen::MatrixXd findGround(const std::vector<ContactMotion>& contacts,
                           const std::vector<PartRobot::Part>& parts,
                           const std::vector<ContactMotion>& motions,
                           const Eigen::MatrixXd& part_ground) {
  const auto count = static_cast<Eigen::Index>(contacts.size());
  const Eigen::Index frames = part_ground.cols();
  Eigen::MatrixXd ground = Eigen::MatrixXd::Constant(count, frames, internal::kNaN);
  for (std::size_t k = 0; k < parts.size(); ++k) {
    if (parts[k].contact >= contacts.size()) continue;
    const auto owner = static_cast<Eigen::Index>(parts[k].contact);
    for (Eigen::Index frame = 0; frame < frames; ++frame) {
      const double height =
          motions[k].height[frame] - part_ground(static_cast<Eigen::Index>(k), frame);
      const double whole = contacts[parts[k].contact].height[frame] - height;
      double& value = ground(owner, frame);
      if (!std::isnan(whole) && !(value >= whole)) value = whole;
    }
  }
  return ground;
}

// The mean height of what is stood on; another where nothing is.
double findMeanGround(const ContactInference& found, double otherwise) {
  double sum = 0.;
  Eigen::Index count = 0;
  for (Eigen::Index frame = 0; frame < found.ground.cols(); ++frame)
    for (Eigen::Index part = 0; part < found.ground.rows(); ++part)
      // Contacts may be recorded where nothing ever rests, whose ground is not known.
      if (found.schedule.active(part, frame) && !std::isnan(found.ground(part, frame))) {
        sum += found.ground(part, frame);
        ++count;
      }
  return count > 0 ? sum / double(count) : otherwise;
}

// How sure recorded contacts are: as the record says, else as sure as can be.
Eigen::MatrixXd findRecordedConfidence(const std::vector<std::string>& names,
                                       const ContactSchedule& recorded) {
  Eigen::MatrixXd confidence =
      Eigen::MatrixXd::Zero(static_cast<Eigen::Index>(names.size()), recorded.active.cols());
  for (std::size_t k = 0; k < recorded.names.size(); ++k) {
    const auto place = std::find(names.begin(), names.end(), recorded.names[k]) - names.begin();
    const auto row = static_cast<Eigen::Index>(k);
    if (recorded.confidence.size() > 0)
      confidence.row(place) = recorded.confidence.row(row);
    else
      confidence.row(place) = recorded.active.row(row).cast<double>();
  }
  return confidence;
}

// In which share of the frames each contact is otherwise in one schedule than in the other.
Eigen::VectorXd findDisagreement(const ContactSchedule::Matrix& one,
                                 const ContactSchedule::Matrix& other) {
  const auto differ = (one.array() != other.array()).cast<double>();
  return differ.rowwise().sum() / double(one.cols());
}

// Frames whose accelerations a filter has smeared: those around the beginning and the end of a
// flight, where the force jumps, by half a period of the cut-off.
void addSmeared(const ContactSchedule& schedule, const Eigen::VectorXd& time, double cutoff,
                Mask& unsure) {
  if (!(cutoff > 0.)) return;
  const double width = 0.5 / cutoff;
  const Eigen::Index frames = time.size();
  for (Eigen::Index frame = 1; frame < frames; ++frame) {
    if (schedule.active.col(frame).any() == schedule.active.col(frame - 1).any()) continue;
    for (Eigen::Index k = frame; k < frames && time[k] - time[frame] <= width; ++k)
      unsure[k] = true;
    for (Eigen::Index k = frame - 1; k >= 0 && time[frame - 1] - time[k] <= width; --k)
      unsure[k] = true;
  }
}

// Lets contacts be active in some frames that are so within half a period of the cut-off.
void widen(const Eigen::VectorXd& time, const Mask& frames, double cutoff,
           ContactSchedule& schedule) {
  const ContactSchedule::Matrix active = schedule.active;
  for (Eigen::Index frame = 0; frame < time.size(); ++frame) {
    if (!frames[frame]) continue;
    for (const int way : {-1, 1})
      for (Eigen::Index k = frame; k >= 0 && k < time.size(); k += way) {
        if (std::abs(time[k] - time[frame]) > 0.5 / cutoff) break;
        schedule.active.col(frame).array() =
            schedule.active.col(frame).array() || active.col(k).array();
      }
  }
}

// Links count if they leave so much less of the frames in which something is missing. A few frames
// less may be chance.
constexpr double kLeastGain = 0.1;
// Who sits lacks more than this [m g], [m g m], where the seat is not known; who leans lacks less.
constexpr double kSeated = 0.1;

// A set whose forces lack less than this gives all that is needed [m g], [m g m].
constexpr double kGiven = 1e-3;

// A motion, what it needs, and how contacts and their parts lie and move in it.
struct SweptMotion {
  const Motion* motion;
  std::vector<ContactMotion> contacts, parts;
  MotionAnalysis analysis;
};

// Velocities as the ground sees them, which may be a treadmill.
void makeRelative(const Eigen::Vector3d& ground_velocity, SweptMotion& swept) {
  if (ground_velocity.isZero(0.)) return;
  for (auto* motions : {&swept.contacts, &swept.parts})
    for (ContactMotion& moved : *motions) moved.velocity.colwise() -= ground_velocity;
}

// The frames in which parts cannot give what is needed: more is missing there than verdicts allow
// in a frame. Verdicts distribute forces for that, and have pyramids for cones.
Mask findMissing(const ContactSplit& split, const SweptMotion& swept,
                 const ContactInference& inference, const Mask& unsure,
                 const VerdictSettings& settings) {
  const double weight = split.carrier.mass * internal::findUnitGravity(split.carrier.gravity);
  internal::SupportMeter support(split.carrier, swept.parts, swept.analysis);
  const auto isMissing = [&](Eigen::Index frame) {
    const double force = internal::orInfinity(inference.missing(0, frame));
    const double torque = internal::orInfinity(inference.missing(1, frame));
    const auto active = inference.schedule.active.col(frame);
    if (!active.any()) return std::max(force, torque) > settings.flight_with_support_needed.limit;
    if (force > settings.residual_force.limit || torque > settings.residual_torque.limit)
      return true;
    if (std::max(force, torque) <= kGiven ||
        swept.analysis.ground_force(2, frame) < settings.cop_force * weight)
      return false;
    const auto isActive = [&](std::size_t part) { return active[Eigen::Index(part)]; };
    return support.measure(frame, isActive) > settings.cop_outside.limit;
  };
  Mask missing = Mask::Constant(unsure.size(), false);
  for (Eigen::Index frame = 0; frame < missing.size(); ++frame)
    missing[frame] = !unsure[frame] && isMissing(frame);
  return missing;
}

// Whether it lasts for so long somewhere. Each frame lasts until the next one.
bool isLong(const Mask& missing, const Eigen::VectorXd& time, double duration) {
  const Eigen::Index last = missing.size() - 1;
  for (Eigen::Index first = 0, behind = 0; first <= last; first = behind + 1) {
    for (behind = first; behind <= last && missing[behind];) ++behind;
    if (behind > first && time[std::min(behind, last)] - time[first] >= duration) return true;
  }
  return false;
}

// Where the ground is under what is at rest on it.
std::vector<double> findLevels(const ContactInference& found) {
  std::vector<double> levels;
  for (const Stance& stance : found.stances)
    if (stance.on_ground) levels.push_back(stance.height);
  return levels;
}

// Takes away what no link does that never carries.
void dropIdle(ContactSchedule& bodies, std::vector<MotionAnalysis::Body>& analyzed) {
  ContactSchedule kept;
  std::vector<MotionAnalysis::Body> kept_analyzed;
  std::vector<Eigen::Index> rows;
  for (std::size_t k = 0; k < analyzed.size(); ++k) {
    if (!analyzed[k].active.any()) continue;
    rows.push_back(static_cast<Eigen::Index>(k));
    kept.names.push_back(bodies.names[k]);
    kept_analyzed.push_back(std::move(analyzed[k]));
  }
  const auto count = static_cast<Eigen::Index>(rows.size());
  kept.active.resize(count, bodies.active.cols());
  if (bodies.confidence.size() > 0) kept.confidence.resize(count, bodies.active.cols());
  for (Eigen::Index k = 0; k < count; ++k) {
    const Eigen::Index row = rows[static_cast<std::size_t>(k)];
    kept.active.row(k) = bodies.active.row(row);
    if (bodies.confidence.size() > 0) kept.confidence.row(k) = bodies.confidence.row(row);
  }
  bodies = std::move(kept);
  analyzed = std::move(kept_analyzed);
}

// The contacts of a robot, and the parts of these.
std::vector<internal::FixedContact> listAll(const DynaCoM& robot, const ContactSplit& split) {
  std::vector<internal::FixedContact> all = internal::describeCarrier(robot).contacts;
  all.insert(all.end(), split.carrier.contacts.begin(), split.carrier.contacts.end());
  return all;
}

}  // namespace

/// What is kept from one motion to the next.
struct MotionExaminer::Workspace {
  Workspace(const DynaCoM& given, const ExaminationSettings& given_settings)
      : robot(given),
        settings(given_settings),
        names(robot.getKnownContacts()),
        split(internal::splitCarrier(robot, {}, given_settings.friction)),
        data([this] { return std::make_unique<pinocchio::Data>(robot.getModel()); }),
        com_sweep(robot.getModel(), {}, given_settings.analysis.lanes, data),
        sweep(robot.getModel(), listAll(robot, split), given_settings.analysis.lanes, data),
        distribution(split.carrier, given_settings.analysis.lanes),
        workers(given_settings.analysis.threads) {}

  MotionExamination examine(const RecordedMotion& recorded,
                            const std::function<void(double)>& progress);

  const DynaCoM robot;
  const ExaminationSettings settings;
  const std::vector<std::string> names;  // of contacts
  const ContactSplit split;              // these, taken apart
  internal::DataPool data;
  const internal::MotionSweep com_sweep, sweep;  // of nothing, and of contacts and parts
  const internal::MotionDistribution distribution;
  internal::Workers workers;
  // Of the progress, which several threads may have to tell; one that is told may examine, too.
  internal::PerProcess<std::recursive_mutex> telling;

 private:
  class Pipeline;
};

// One motion. Its steps stand in the order in which they are taken.
class MotionExaminer::Workspace::Pipeline {
 public:
  Pipeline(Workspace& workspace, const RecordedMotion& recorded,
           const std::function<void(double)>& progress)
      : workspace_(workspace),
        recorded_(recorded),
        settings_(workspace.settings),
        progress_(progress) {}

  MotionExamination examine() {
    MotionExamination found = {};
    found.derived = internal::deriveMotion(derivation_, recorded_, settings_.cutoff);
    const std::vector<double> cutoffs = findOtherCutoffs(found.derived);
    passes_ = 2. + 2. * double(cutoffs.size());
    if (recorded_.schedule)
      for (const std::string& name : recorded_.schedule->names) workspace_.robot.getContact(name);
    SweptMotion swept = sweep(found.derived.motion);
    steps_ = internal::measureStepSpeeds(model(), recorded_.time, recorded_.q, settings_.verdict);
    near_jumps_ = internal::findNearJumps(recorded_.time, steps_, settings_.verdict);

    found.inference = infer(found.derived, swept);
    if (recorded_.schedule)
      found.inferred = gather(inferFrom(*split_, found.derived, swept, nullptr).schedule);
    makeRelative(found.inference.ground_velocity, swept);
    distribute(found.inference, swept);
    found.verdict = judge(found.derived, found.inference, swept);
    found.distance = weighDistance(found.derived, found.inference, swept, found.verdict);
    found.seats = findSeats(found.inference, swept, found.verdict);
    write(swept, found);
    for (const double cutoff : cutoffs) found.sensitivity.push_back(tryCutoff(cutoff, found));
    return found;
  }

 private:
  const pinocchio::Model& model() const { return workspace_.robot.getModel(); }

  // Tells what part of all passes through the frames is done.
  std::function<void(Eigen::Index)> tellPass() {
    if (!progress_) return nullptr;
    const double before = done_++;
    const auto frames = double(recorded_.time.size());
    return [this, before, frames](Eigen::Index done) {
      const std::lock_guard<std::recursive_mutex> lock(workspace_.telling.get());
      progress_((before + double(done) / frames) / passes_);
    };
  }

  Eigen::Matrix3Xd findCoM(const Eigen::MatrixXd& q) const {
    const Eigen::MatrixXd rest = Eigen::MatrixXd::Zero(model().nv, q.cols());
    const auto frames = double(q.cols());
    std::vector<ContactMotion> nothing;
    MotionAnalysis dynamics;
    workspace_.com_sweep.run({Eigen::VectorXd::LinSpaced(q.cols(), 1., frames), q, rest, rest},
                             workspace_.workers, nothing, &dynamics);
    return std::move(dynamics.com);
  }

  std::vector<double> findOtherCutoffs(const DerivedMotion& derived) const {
    std::vector<double> cutoffs;
    if (settings_.sensitivity && derived.cutoff > 0.)
      for (const double cutoff : {0.5 * derived.cutoff, 2. * derived.cutoff})
        if (cutoff >= kMinimalCutoff * derived.frame_rate &&
            cutoff < kMaximalCutoff * derived.frame_rate)
          cutoffs.push_back(cutoff);
    return cutoffs;
  }

  // Links, if there are any in use, come behind the contacts' parts.
  SweptMotion sweep(const Motion& motion) {
    SweptMotion swept = {&motion, {}, {}, {}};
    std::vector<ContactMotion>& all = swept.contacts;
    workspace_.sweep.run(motion, workspace_.workers, all, &swept.analysis, tellPass());
    const auto parts = all.begin() + std::ptrdiff_t(workspace_.names.size());
    swept.parts.assign(std::make_move_iterator(parts), std::make_move_iterator(all.end()));
    all.erase(parts, all.end());
    addLinks(swept);
    return swept;
  }

  void addLinks(SweptMotion& swept) {
    if (!link_sweep_) return;
    std::vector<ContactMotion> links;
    link_sweep_->run(*swept.motion, workspace_.workers, links, nullptr);
    std::move(links.begin(), links.end(), std::back_inserter(swept.parts));
  }

  ContactInference inferFrom(const ContactSplit& split, const DerivedMotion& derived,
                             const SweptMotion& swept, const ContactSchedule* recorded) const {
    return internal::inferContacts(split, swept.parts, swept.analysis, derived.isExact(),
                                   settings_.detection, recorded);
  }

  // Finds contacts with links, where those without do not suffice and some links are low then, and
  // takes the links if they help.
  ContactInference infer(const DerivedMotion& derived, SweptMotion& swept) {
    const ContactSchedule* recorded = recorded_.schedule ? &*recorded_.schedule : nullptr;
    ContactInference found = inferFrom(*split_, derived, swept, recorded);
    const std::size_t count = split_->parts.size();
    if (settings_.bodies.empty() || count >= internal::ConeProjection::kMaximalPoints) return found;
    const auto lacks = [&](const ContactSplit& split, const ContactInference& inference) {
      return findMissing(split, swept, inference, findUnsure(derived, inference),
                         settings_.verdict);
    };
    const Mask missing = lacks(*split_, found);
    if (!isLong(missing, swept.motion->time, settings_.verdict.interruption)) return found;
    const std::vector<BodyPoints> bodies =
        internal::screenBodies(model(), *workspace_.data.take(), settings_.bodies, *swept.motion,
                               missing, findLevels(found), settings_.detection.body_reach,
                               internal::ConeProjection::kMaximalPoints - count);
    if (bodies.empty()) return found;

    links_.emplace(internal::splitCarrier(workspace_.robot, bodies, settings_.friction));
    const auto& points = links_->carrier.contacts;
    link_sweep_.emplace(
        model(),
        std::vector<internal::FixedContact>(points.begin() + std::ptrdiff_t(count), points.end()),
        settings_.analysis.lanes, workspace_.data);
    addLinks(swept);
    ContactInference other = inferFrom(*links_, derived, swept, recorded);
    const Eigen::Index given = missing.count() - lacks(*links_, other).count();
    if (given > 0 && double(given) >= kLeastGain * double(missing.count())) {
      split_ = &*links_;
      screened_ = bodies;
      return other;
    }
    link_sweep_.reset();
    swept.parts.resize(count);
    return found;
  }

  Mask findUnsure(const DerivedMotion& derived, const ContactInference& inference) const {
    Mask unsure = near_jumps_ || derived.unsure;
    addSmeared(inference.schedule, derived.motion.time, derived.cutoff, unsure);
    return unsure;
  }

  // Of parts that stand on a slope at some time, and push along the vertical by themselves, makes
  // such as push along the normal that they have in a frame.
  void makeTilting(const std::vector<Stance>& stances) {
    std::vector<bool> on_slope(split_->parts.size(), false);
    for (const Stance& stance : stances)
      if (!stance.slope.isZero(0.)) on_slope[stance.part] = true;
    if (std::find(on_slope.begin(), on_slope.end(), true) == on_slope.end()) return;
    tilted_ = *split_;
    for (std::size_t k = 0; k < on_slope.size(); ++k) {
      internal::FixedContact& fixed = tilted_->carrier.contacts[k];
      const auto* point = dynamic_cast<const ContactPoint*>(fixed.contact.get());
      tilts_.push_back(on_slope[k] && point && point->getSettings().world_aligned);
      if (!tilts_.back()) continue;
      ContactPointSettings settings = point->getSettings();
      settings.world_aligned = false;
      fixed.contact = std::make_shared<ContactPoint>(settings);
    }
    split_ = &*tilted_;
  }

  // In stances on slopes, parts have the slope's normal in place of the vertical.
  void tilt(const std::vector<Stance>& stances, SweptMotion& swept) {
    if (!tilted_) makeTilting(stances);
    if (!tilted_) return;
    for (const Stance& stance : stances) {
      if (!tilts_[stance.part] || stance.slope.isZero(0.)) continue;
      const Eigen::Vector3d normal(-stance.slope.x(), -stance.slope.y(), 1.);
      const auto rotation = Eigen::Quaterniond::FromTwoVectors(Eigen::Vector3d::UnitZ(), normal);
      const auto turn = [&](ContactMotion& moved) {
        moved.rotation.middleCols(stance.begin, stance.end - stance.begin).colwise() =
            rotation.coeffs();
      };
      turn(swept.parts[stance.part]);
      const PartRobot::Part& part = split_->parts[stance.part];
      // A point is its own part.
      if (part.contact < swept.contacts.size() && swept.contacts[part.contact].name == part.name)
        turn(swept.contacts[part.contact]);
    }
  }

  void distribute(const ContactInference& inference, SweptMotion& swept) {
    tilt(inference.stances, swept);
    const double given = settings_.detection.ground_height;
    const double ground_height =
        findMeanGround(inference, std::isnan(given) ? workspace_.robot.getGroundHeight() : given);
    const auto run = [&](const internal::MotionDistribution& distribution) {
      distribution.run(inference.schedule, swept.parts, ground_height, settings_.analysis,
                       workspace_.workers, swept.analysis, tellPass());
    };
    if (split_ == &workspace_.split)
      run(workspace_.distribution);
    else
      run(internal::MotionDistribution(split_->carrier, settings_.analysis.lanes));
  }

  MotionVerdict judge(const DerivedMotion& derived, const ContactInference& inference,
                      const SweptMotion& swept) const {
    const ContactSchedule whole = gather(inference.schedule);
    return internal::judgeMotion(
        {split_->carrier, derived.motion.time, steps_, swept.parts, inference.ground,
         swept.analysis, swept.contacts, whole.active, near_jumps_, findUnsure(derived, inference),
         internal::isTooShort(derived.motion, recorded_)},
        settings_.verdict, workspace_.workers);
  }

  // Tells a verdict of the distance, if somebody asks for it and something can be said. Around
  // flights, where accelerations are smeared, what pushes a little earlier or later may push.
  std::optional<CentroidalChange> weighDistance(const DerivedMotion& derived,
                                                const ContactInference& inference,
                                                const SweptMotion& swept,
                                                MotionVerdict& verdict) const {
    const MotionAnalysis& needed = swept.analysis;
    if (!settings_.distance || verdict.outcome == MotionOutcome::Unknown || verdict.unsure.all() ||
        !needed.com.allFinite() || !needed.ground_force.allFinite() ||
        !needed.ground_torque.allFinite())
      return std::nullopt;
    ContactSchedule schedule = inference.schedule;
    const Eigen::VectorXd& time = derived.motion.time;
    Mask smeared = Mask::Constant(time.size(), false);
    addSmeared(schedule, time, derived.cutoff, smeared);
    widen(time, smeared, derived.cutoff, schedule);
    CentroidalChange change = internal::distanceToFeasible(
        *split_, swept.parts, swept.analysis, schedule, settings_.filter,
        near_jumps_ || derived.unsure, workspace_.workers);
    verdict.weighDistance(change, time, settings_.verdict);
    return change;
  }

  // Looks for seats where more is missing than who leans lacks.
  std::vector<Seat> findSeats(const ContactInference& inference, const SweptMotion& swept,
                              const MotionVerdict& verdict) const {
    if (settings_.bodies.empty()) return {};
    const std::vector<double> levels = findLevels(inference);
    Mask missing = Mask::Constant(swept.motion->frames(), false);
    for (const MotionFault fault : {MotionFault::ResidualForce, MotionFault::ResidualTorque,
                                    MotionFault::FlightWithSupportNeeded})
      missing = missing || verdict[fault].measured.array() > kSeated;
    if (levels.empty() || !missing.any()) return {};
    return internal::findSeats(
        settings_.bodies, *swept.motion,
        {model(), *workspace_.data.take(), *split_, swept.parts, inference.schedule, swept.analysis,
         missing, *std::max_element(levels.begin(), levels.end())},
        settings_);
  }

  ContactSchedule gather(const ContactSchedule& schedule) const {
    return internal::gatherParts(workspace_.names, *split_, schedule);
  }

  // Writes what was found of parts as that of contacts.
  void write(SweptMotion& swept, MotionExamination& found) const {
    const ContactSchedule& schedule = found.inference.schedule;
    found.schedule = gather(schedule);
    if (recorded_.schedule)
      found.schedule.confidence = findRecordedConfidence(found.schedule.names, *recorded_.schedule);
    found.bodies = internal::gatherBodies(*split_, schedule);
    found.parts = split_->parts;
    found.links = screened_;
    if (found.inferred)
      found.disagreement = findDisagreement(found.schedule.active, found.inferred->active);
    found.ground = findGround(swept.contacts, found.parts, swept.parts, found.inference.ground);
    found.terrain = findTerrain(found.parts, found.inference, found.schedule, found.ground,
                                found.derived.motion.time, settings_.detection.ground_height);
    found.analysis = internal::gatherParts(workspace_.robot, *split_, swept.contacts, swept.parts,
                                           std::move(swept.analysis));
    dropIdle(found.bodies, found.analysis.bodies);
    found.missing_support =
        findMissingSupport(workspace_.robot, found.analysis, found.verdict, settings_.verdict);
    found.contacts = std::move(swept.contacts);
    found.part_motions = std::move(swept.parts);
    found.statistics =
        summarizeMotion(workspace_.robot, found.derived.motion, found.analysis, found.verdict);
  }

  CutoffSensitivity tryCutoff(double cutoff, const MotionExamination& found) {
    const DerivedMotion derived = internal::rederiveMotion(derivation_, recorded_, cutoff);
    SweptMotion swept = sweep(derived.motion);
    makeRelative(found.inference.ground_velocity, swept);
    distribute(found.inference, swept);
    MotionVerdict verdict = judge(derived, found.inference, swept);
    weighDistance(derived, found.inference, swept, verdict);
    MotionStatistics statistics =
        summarizeMotion(workspace_.robot, derived.motion,
                        internal::gatherParts(workspace_.robot, *split_, swept.contacts,
                                              swept.parts, std::move(swept.analysis)),
                        verdict);
    return {cutoff, std::move(verdict), std::move(statistics)};
  }

  Workspace& workspace_;
  const RecordedMotion& recorded_;
  const ExaminationSettings& settings_;
  const std::function<void(double)>& progress_;
  const internal::Derivation derivation_ = {
      model(), workspace_.data, [this](const Eigen::MatrixXd& q) { return findCoM(q); }};
  double passes_ = 1., done_ = 0.;
  internal::StepSpeeds steps_;
  Mask near_jumps_;
  const ContactSplit* split_ = &workspace_.split;  // what carries: the contacts, or
  std::optional<ContactSplit> links_;              // those with links besides,
  std::vector<BodyPoints> screened_;               // these links, if they carry,
  std::optional<ContactSplit> tilted_;             // and on slopes these, along their normals,
  std::vector<bool> tilts_;                        // as far as they have the ground's
  std::optional<internal::MotionSweep> link_sweep_;
};

MotionExamination MotionExaminer::Workspace::examine(const RecordedMotion& recorded,
                                                     const std::function<void(double)>& progress) {
  return Pipeline(*this, recorded, progress).examine();
}

MotionExaminer::MotionExaminer(const DynaCoM& robot, const ExaminationSettings& settings) {
  if (!robot.isInitialized())
    throw NotReadyError("DynaCoM is used by MotionExaminer before initialize()");
  settings.validate();
  workspace_ = std::make_unique<Workspace>(robot, settings);
}

MotionExaminer::MotionExaminer(const MotionExaminer& other)
    : workspace_(std::make_unique<Workspace>(other.workspace_->robot, other.workspace_->settings)) {
}

MotionExaminer::~MotionExaminer() = default;
MotionExaminer::MotionExaminer(MotionExaminer&&) noexcept = default;
MotionExaminer& MotionExaminer::operator=(MotionExaminer other) noexcept {
  workspace_.swap(other.workspace_);
  return *this;
}

const ExaminationSettings& MotionExaminer::getSettings() const { return workspace_->settings; }

MotionExamination MotionExaminer::examine(const RecordedMotion& recorded) const {
  return workspace_->examine(recorded, workspace_->settings.progress);
}

MotionExamination examineMotion(const DynaCoM& robot, const RecordedMotion& recorded,
                                const ExaminationSettings& settings) {
  return MotionExaminer(robot, settings).examine(recorded);
}

void MotionExaminer::examineMany(
    std::size_t clips, const std::function<RecordedMotion(std::size_t)>& read,
    const std::function<void(std::size_t, const MotionExamination*, const std::string&)>& done)
    const {
  std::mutex one_at_a_time;
  bool ends = false;
  const auto examineClip = [&](Eigen::Index index) {
    const auto clip = static_cast<std::size_t>(index);
    std::optional<MotionExamination> found;
    std::string error;
    try {
      found = workspace_->examine(read(clip), nullptr);
    } catch (const std::exception& exception) {
      error = exception.what();
    } catch (...) {
      error = "unknown exception";
    }
    const std::lock_guard<std::mutex> lock(one_at_a_time);
    if (ends) return;
    ends = true;  // if the next throws
    done(clip, found ? &*found : nullptr, error);
    ends = false;
  };
  workspace_->workers.forEach(static_cast<Eigen::Index>(clips),
                              [&]() -> internal::Workers::Work { return examineClip; });
}

void analyzeMotions(
    const DynaCoM& robot, std::size_t clips, const std::function<RecordedMotion(std::size_t)>& read,
    const std::function<void(std::size_t, const MotionExamination*, const std::string&)>& done,
    const ExaminationSettings& settings) {
  MotionExaminer(robot, settings).examineMany(clips, read, done);
}

}  // namespace dynacom
