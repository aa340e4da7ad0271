// SPDX-License-Identifier: BSD-2-Clause
#include "dynacom/motion_examination.hpp"

#include <algorithm>
#include <cmath>
#include <exception>
#include <mutex>
#include <utility>

#include "body_screening.hpp"
#include "check.hpp"
#include "motion_steps.hpp"
#include "nan.hpp"
#include "seat_search.hpp"

namespace dynacom {

void ExaminationSettings::validate() const {
  internal::requireField(std::isnan(cutoff) || (cutoff >= 0. && std::isfinite(cutoff)),
                         "ExaminationSettings.cutoff", "finite and >= 0 Hz, or NaN", cutoff);
  analysis.validate();
  detection.validate();
  verdict.validate();
}

namespace {

// Velocities as the ground sees them, which may be a treadmill.
void makeRelative(const Eigen::Vector3d& ground_velocity, std::vector<ContactMotion>& motions) {
  if (ground_velocity.isZero(0.)) return;
  for (ContactMotion& moved : motions) moved.velocity.colwise() -= ground_velocity;
}

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

// Frames whose accelerations a filter has smeared: those around the beginning and the end of a
// flight, where the force jumps, by half a period of the cut-off.
void addSmeared(const ContactSchedule& schedule, const Eigen::VectorXd& time, double cutoff,
                Eigen::Array<bool, Eigen::Dynamic, 1>& unsure) {
  if (!(cutoff > 0.)) return;
  const double width = 0.5 / cutoff;
  const Eigen::Index frames = time.size();
  if (unsure.size() == 0) unsure.setConstant(frames, false);
  for (Eigen::Index frame = 1; frame < frames; ++frame) {
    if (schedule.active.col(frame).any() == schedule.active.col(frame - 1).any()) continue;
    for (Eigen::Index k = frame; k < frames && time[k] - time[frame] <= width; ++k)
      unsure[k] = true;
    for (Eigen::Index k = frame - 1; k >= 0 && time[frame - 1] - time[k] <= width; --k)
      unsure[k] = true;
  }
}

// Links count if they leave so much less of the frames in which something is missing. A few frames
// less may be chance.
constexpr double kLeastGain = 0.1;
// And they are looked for if something is missing in more of the frames than this: the verdict
// bears as many.
constexpr double kMuch = 0.02;
// Who sits lacks more than this [m g], [m g m], where the seat is not known; who leans lacks less.
constexpr double kSeated = 0.1;

// How many points there may be at most, see inferContacts().
constexpr std::size_t kMaximalParts = 32;

// The frames in which contacts cannot give what is needed.
Eigen::Array<bool, Eigen::Dynamic, 1> findMissing(const MotionVerdict& verdict,
                                                  const VerdictSettings& settings) {
  Eigen::Array<bool, Eigen::Dynamic, 1> missing =
      Eigen::Array<bool, Eigen::Dynamic, 1>::Constant(verdict.unsure.size(), false);
  for (const MotionFault fault : {MotionFault::ResidualForce, MotionFault::ResidualTorque,
                                  MotionFault::CoPOutside, MotionFault::FlightWithSupportNeeded})
    missing = missing || verdict[fault].measured.array() > settings[fault].limit;
  return missing;
}

bool isMuch(const Eigen::Array<bool, Eigen::Dynamic, 1>& missing) {
  return double(missing.count()) > kMuch * double(missing.size());
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

// A motion with certain parts of a robot.
struct Attempt {
  const PartRobot* parts;
  internal::Desks* desks;
  std::vector<ContactMotion> motions;  // relative to the ground
  ContactInference inference;
  std::optional<ContactSchedule> inferred;
  double ground_height;
  MotionAnalysis analysis;
  MotionVerdict verdict;
};

}  // namespace

/// What is kept from one motion to the next.
struct MotionExaminer::Office {
  Office(const DynaCoM& given, const ExaminationSettings& given_settings)
      : robot(given),
        parts(splitContacts(robot)),
        settings(given_settings),
        desks(robot, given_settings.analysis.lanes),
        part_desks(parts.robot, given_settings.analysis.lanes),
        workers(given_settings.analysis.threads) {}

  MotionExamination examine(const RecordedMotion& recorded,
                            const std::function<void(double)>& progress);

  const DynaCoM robot;
  const PartRobot parts;
  const ExaminationSettings settings;
  internal::Desks desks, part_desks;
  internal::Workers workers;
};

MotionExamination MotionExaminer::Office::examine(const RecordedMotion& recorded,
                                                  const std::function<void(double)>& progress) {
  MotionExamination found = {};
  found.derived = deriveMotion(robot.getModel(), recorded, settings.cutoff);
  const Motion& motion = found.derived.motion;
  found.contacts = internal::computeContactMotions(desks, motion, workers);

  std::vector<double> cutoffs;
  if (settings.sensitivity && found.derived.cutoff > 0.)
    for (const double cutoff : {0.5 * found.derived.cutoff, 2. * found.derived.cutoff})
      if (cutoff < kMaximalCutoff * found.derived.frame_rate) cutoffs.push_back(cutoff);
  Eigen::Index done = 0;
  const auto work = double(motion.frames()) * double(2 + !settings.bodies.empty() + cutoffs.size());
  AnalysisSettings analysis_settings = settings.analysis;
  analysis_settings.progress = nullptr;
  if (progress)
    analysis_settings.progress = [&](Eigen::Index frames) {
      progress(double(done + frames) / work);
    };
  const auto analyze = [&](internal::Desks& part_robots, const Motion& moved,
                           const ContactSchedule& schedule, double ground_height) {
    MotionAnalysis analysis = internal::analyzeMotion(part_robots, ground_height, moved, schedule,
                                                      analysis_settings, workers);
    done += motion.frames();
    return analysis;
  };
  const auto judge = [&](const Attempt& attempt, const DerivedMotion& derived,
                         const std::vector<ContactMotion>& motions,
                         const MotionAnalysis& analysis) {
    Eigen::Array<bool, Eigen::Dynamic, 1> unsure = derived.unsure;
    addSmeared(attempt.inference.schedule, derived.motion.time, derived.cutoff, unsure);
    return internal::judgeMotion(attempt.parts->robot, derived.motion, recorded, motions,
                                 attempt.inference.ground, analysis, unsure, settings.verdict,
                                 workers);
  };

  ContactSchedule none;
  none.active.resize(0, motion.frames());
  const MotionAnalysis dynamics = analyze(part_desks, motion, none, robot.getGroundHeight());
  const bool exact = found.derived.cutoff == 0. ||
                     (found.derived.is_automatic && found.derived.thinned_noise <= kExactNoise);
  if (recorded.schedule.has_value())
    for (const std::string& name : recorded.schedule->names) robot.getContact(name);
  const auto attempt = [&](const PartRobot& used, internal::Desks& used_desks) {
    Attempt made = {&used, &used_desks, {}, {}, {}, 0., {}, {}};
    made.motions = internal::computeContactMotions(used_desks, motion, workers);
    const auto infer = [&](const ContactSchedule* schedule) {
      return inferContacts(used, made.motions, dynamics, exact, settings.detection, schedule);
    };
    made.inference = infer(recorded.schedule ? &*recorded.schedule : nullptr);
    if (recorded.schedule) made.inferred = gatherParts(robot, used, infer(nullptr).schedule);
    makeRelative(made.inference.ground_velocity, made.motions);
    const double given = settings.detection.ground_height;
    made.ground_height =
        findMeanGround(made.inference, std::isnan(given) ? robot.getGroundHeight() : given);
    made.analysis = analyze(used_desks, motion, made.inference.schedule, made.ground_height);
    made.verdict = judge(made, found.derived, made.motions, made.analysis);
    return made;
  };

  Attempt best = attempt(parts, part_desks);
  // With links, where the contacts alone do not suffice, and some are low then.
  std::optional<PartRobot> body_parts;
  std::optional<internal::Desks> body_desks;
  if (!settings.bodies.empty()) {
    const Eigen::Array<bool, Eigen::Dynamic, 1> missing =
        findMissing(best.verdict, settings.verdict);
    std::vector<BodyPoints> bodies;
    if (isMuch(missing) && parts.parts.size() < kMaximalParts)
      bodies = internal::screenBodies(robot.getModel(), settings.bodies, motion, missing,
                                      findLevels(best.inference), settings.detection.body_reach,
                                      kMaximalParts - parts.parts.size());
    if (bodies.empty()) {
      done += motion.frames();
      if (progress) progress(double(done) / work);
    } else {
      body_parts.emplace(splitContacts(robot, bodies));
      body_desks.emplace(body_parts->robot, settings.analysis.lanes);
      Attempt other = attempt(*body_parts, *body_desks);
      const Eigen::Index given =
          missing.count() - findMissing(other.verdict, settings.verdict).count();
      if (given > 0 && double(given) >= kLeastGain * double(missing.count()))
        best = std::move(other);
    }
  }

  const PartRobot& used = *best.parts;
  found.parts = used.parts;
  found.part_motions = std::move(best.motions);
  found.inferred = std::move(best.inferred);
  const ContactSchedule& schedule = best.inference.schedule;
  found.schedule = gatherParts(robot, used, schedule);
  if (recorded.schedule.has_value())
    found.schedule.confidence = findRecordedConfidence(found.schedule.names, *recorded.schedule);
  found.bodies = gatherBodies(used, schedule);
  found.ground = findGround(found.contacts, used.parts, found.part_motions, best.inference.ground);
  if (!settings.bodies.empty()) {
    const std::vector<double> levels = findLevels(best.inference);
    Eigen::Array<bool, Eigen::Dynamic, 1> missing(motion.frames());
    missing.setConstant(false);
    for (const MotionFault fault : {MotionFault::ResidualForce, MotionFault::ResidualTorque,
                                    MotionFault::FlightWithSupportNeeded})
      missing = missing || best.verdict[fault].measured.array() > kSeated;
    if (!levels.empty() && isMuch(missing))
      found.seats = internal::findSeats(settings.bodies, motion,
                                        {used, found.part_motions, schedule, best.analysis, missing,
                                         *std::max_element(levels.begin(), levels.end())},
                                        settings);
  }
  found.verdict = std::move(best.verdict);
  found.analysis =
      gatherParts(robot, used, found.contacts, found.part_motions, std::move(best.analysis));
  dropIdle(found.bodies, found.analysis.bodies);
  internal::judgeNormals(found.contacts, found.analysis.contacts, motion.time, settings.verdict,
                         found.verdict);
  found.statistics = summarizeMotion(robot, motion, found.analysis, found.verdict);
  for (const double cutoff : cutoffs) {
    const DerivedMotion other = rederiveMotion(robot.getModel(), recorded, cutoff);
    const MotionAnalysis other_analysis =
        analyze(*best.desks, other.motion, schedule, best.ground_height);
    std::vector<ContactMotion> motions =
        internal::computeContactMotions(*best.desks, other.motion, workers);
    makeRelative(best.inference.ground_velocity, motions);
    CutoffSensitivity sensitivity = {};
    sensitivity.cutoff = cutoff;
    sensitivity.verdict = judge(best, other, motions, other_analysis);
    internal::judgeNormals(found.contacts, found.analysis.contacts, motion.time, settings.verdict,
                           sensitivity.verdict);
    sensitivity.statistics = summarizeMotion(
        robot, other.motion,
        gatherParts(robot, used, internal::computeContactMotions(desks, other.motion, workers),
                    motions, other_analysis),
        sensitivity.verdict);
    found.sensitivity.push_back(std::move(sensitivity));
  }
  found.inference = std::move(best.inference);
  return found;
}

MotionExaminer::MotionExaminer(const DynaCoM& robot, const ExaminationSettings& settings) {
  if (!robot.isInitialized())
    throw NotReadyError("DynaCoM is used by MotionExaminer before initialize()");
  settings.validate();
  office_ = std::make_unique<Office>(robot, settings);
}

MotionExaminer::MotionExaminer(const MotionExaminer& other)
    : office_(std::make_unique<Office>(other.office_->robot, other.office_->settings)) {}

MotionExaminer::~MotionExaminer() = default;
MotionExaminer::MotionExaminer(MotionExaminer&&) noexcept = default;
MotionExaminer& MotionExaminer::operator=(MotionExaminer other) noexcept {
  office_.swap(other.office_);
  return *this;
}

const ExaminationSettings& MotionExaminer::getSettings() const { return office_->settings; }

MotionExamination MotionExaminer::examine(const RecordedMotion& recorded) const {
  return office_->examine(recorded, office_->settings.progress);
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
      found = office_->examine(read(clip), nullptr);
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
  office_->workers.forEach(static_cast<Eigen::Index>(clips),
                           [&]() -> internal::Workers::Work { return examineClip; });
}

void analyzeMotions(
    const DynaCoM& robot, std::size_t clips, const std::function<RecordedMotion(std::size_t)>& read,
    const std::function<void(std::size_t, const MotionExamination*, const std::string&)>& done,
    const ExaminationSettings& settings) {
  MotionExaminer(robot, settings).examineMany(clips, read, done);
}

}  // namespace dynacom
