// SPDX-License-Identifier: BSD-2-Clause
#include "dynacom/motion_examination.hpp"

#include <cmath>
#include <exception>
#include <mutex>
#include <utility>

#include "check.hpp"
#include "motion_steps.hpp"

namespace dynacom {

void ExaminationSettings::validate() const {
  internal::requireField(std::isnan(cutoff) || (cutoff >= 0. && std::isfinite(cutoff)),
                         "ExaminationSettings.cutoff", "finite and >= 0 Hz, or NaN", cutoff);
  analysis.validate();
  detection.validate();
  verdict.validate();
}

/// What is kept from one motion to the next.
struct MotionExaminer::Office {
  Office(const DynaCoM& given, const ExaminationSettings& given_settings)
      : robot(given),
        settings(given_settings),
        desks(robot, given_settings.analysis.lanes),
        workers(given_settings.analysis.threads) {}

  MotionExamination examine(const RecordedMotion& recorded,
                            const std::function<void(double)>& progress);

  const DynaCoM robot;
  const ExaminationSettings settings;
  internal::Desks desks;
  internal::Workers workers;
};

MotionExamination MotionExaminer::Office::examine(const RecordedMotion& recorded,
                                                  const std::function<void(double)>& progress) {
  MotionExamination found = {};
  found.derived = deriveMotion(robot.getModel(), recorded, settings.cutoff);
  const Motion& motion = found.derived.motion;
  found.contacts = internal::computeContactMotions(desks, motion, workers);
  found.ground = estimateGround(found.contacts, motion.time, settings.detection);
  found.schedule = recorded.schedule.has_value() ? *recorded.schedule
                                                 : detectContacts(found.contacts, motion.time,
                                                                  found.ground, settings.detection);
  const double ground_height =
      found.ground.size() > 0 ? found.ground.mean() : robot.getGroundHeight();

  std::vector<double> cutoffs;
  if (settings.sensitivity && found.derived.cutoff > 0.)
    for (const double cutoff : {0.5 * found.derived.cutoff, 2. * found.derived.cutoff})
      if (cutoff < kMaximalCutoff * found.derived.frame_rate) cutoffs.push_back(cutoff);

  Eigen::Index done = 0;
  const auto work = double(motion.frames()) * double(1 + cutoffs.size());
  AnalysisSettings analysis_settings = settings.analysis;
  analysis_settings.progress = nullptr;
  if (progress)
    analysis_settings.progress = [&](Eigen::Index frames) {
      progress(double(done + frames) / work);
    };
  const auto analyze = [&](const Motion& moved) {
    MotionAnalysis analysis = internal::analyzeMotion(desks, ground_height, moved, found.schedule,
                                                      analysis_settings, workers);
    done += motion.frames();
    return analysis;
  };
  const auto judge = [&](const Motion& moved, const std::vector<ContactMotion>& contacts,
                         const MotionAnalysis& analysis) {
    return internal::judgeMotion(desks, moved, recorded, contacts, found.ground, analysis,
                                 settings.verdict, workers);
  };
  found.analysis = analyze(motion);
  found.verdict = judge(motion, found.contacts, found.analysis);
  found.statistics = summarizeMotion(robot, motion, found.analysis, found.verdict);
  for (const double cutoff : cutoffs) {
    const Motion other = rederiveMotion(robot.getModel(), recorded, cutoff).motion;
    const MotionAnalysis analysis = analyze(other);
    CutoffSensitivity sensitivity = {};
    sensitivity.cutoff = cutoff;
    sensitivity.verdict =
        judge(other, internal::computeContactMotions(desks, other, workers), analysis);
    sensitivity.statistics = summarizeMotion(robot, other, analysis, sensitivity.verdict);
    found.sensitivity.push_back(std::move(sensitivity));
  }
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
