// SPDX-License-Identifier: BSD-2-Clause
// What does the analysis of a whole clip cost, frame by frame, in one thread and in two? It is
// measured against what one would do without: Pinocchio's call for each frame, and eiquadprog's
// plain solver, with all matrices prepared beforehand.
//
// One clip stands on two soles and sways, so that no inequality is active. The other, if there is
// the file, is a recorded dance: in many of its frames the wrench is out of reach, where eiquadprog
// has no answer, and in some no foot is on the ground, where it is not asked. It is analysed with
// the soles' corners in their place, too, as motions are judged: with pyramids and with cones.
#include <malloc.h>

#include <cmath>
#include <dynacom/motion_examination.hpp>
#include <fstream>
#include <pinocchio/algorithm/centroidal.hpp>
#include <pinocchio/algorithm/joint-configuration.hpp>
#include <sstream>
#include <stdexcept>

#include "cases.hpp"
#include "robots.hpp"

namespace dynacom::benchmarks {
namespace {

constexpr Eigen::Index kFrames = 1024, kManyFrames = 16384;
// Of clips as datasets have them.
constexpr Eigen::Index kClipFrames = 300;
constexpr std::size_t kClips = 64;
// Of how many frames the general solver gets the problems, one after the other: few enough that
// their matrices stay in the cache.
constexpr Eigen::Index kPrograms = 32;
constexpr double kDanceRate = 60., kDanceCutoff = 6.;  // [Hz]

struct Clip {
  DynaCoM robot;
  Motion motion;
  ContactSchedule schedule;
};

AnalysisSettings makeSettings(int threads, int lanes) {
  AnalysisSettings settings;
  settings.threads = threads;
  settings.lanes = lanes;
  return settings;
}

// All joints above the legs, each with a frequency and a phase of its own.
Clip makeSway(Eigen::Index frames) {
  Clip clip = {makeG1(), {}, {}};
  const pinocchio::Model& model = clip.robot.getModel();
  const Eigen::Index legs = 12;
  clip.motion.time = Eigen::VectorXd::LinSpaced(frames, 0., double(frames - 1) / kDanceRate);
  clip.motion.q = pinocchio::neutral(model).replicate(1, frames);
  clip.motion.q.row(2).setConstant(0.8);
  clip.motion.v = clip.motion.a = Eigen::MatrixXd::Zero(model.nv, frames);
  for (Eigen::Index joint = legs; joint < model.nv - 6; ++joint) {
    const double frequency = 1.5 + 0.05 * double(joint), size = 0.1;
    for (Eigen::Index frame = 0; frame < frames; ++frame) {
      const double angle = frequency * clip.motion.time[frame] + double(joint);
      clip.motion.q(7 + joint, frame) = size * std::sin(angle);
      clip.motion.v(6 + joint, frame) = size * frequency * std::cos(angle);
      clip.motion.a(6 + joint, frame) = -size * frequency * frequency * std::sin(angle);
    }
  }
  clip.schedule = {{"left_sole", "right_sole"}, ContactSchedule::Matrix::Constant(2, frames, true)};

  const MotionAnalysis analysis = analyzeMotion(clip.robot, clip.motion, clip.schedule);
  for (const MotionAnalysis::Contact& contact : analysis.contacts)
    if (!(contact.friction_usage.maxCoeff() < 0.99 && contact.yaw_usage.maxCoeff() < 0.99 &&
          contact.cop_margin.minCoeff() > 1e-4))
      throw std::logic_error("an inequality is active in the clip that sways");
  return clip;
}

// What of a sole carries.
enum class Carried { Soles, Pyramids, Cones };

Clip readDance(Carried carried) {
  std::ifstream file(DYNACOM_DANCE);
  std::vector<double> numbers;
  for (std::string line, number; std::getline(file, line);)
    for (std::istringstream cells(line); std::getline(cells, number, ',');)
      numbers.push_back(std::stod(number));
  Clip clip = {makeG1(), {}, {}};
  const pinocchio::Model& model = clip.robot.getModel();
  const Eigen::Index frames = Eigen::Index(numbers.size()) / model.nq;
  Eigen::MatrixXd q = Eigen::Map<Eigen::MatrixXd>(numbers.data(), model.nq, frames);
  q.middleRows<4>(3).colwise().normalize();
  const Eigen::VectorXd time =
      Eigen::VectorXd::LinSpaced(frames, 0., double(frames - 1) / kDanceRate);
  clip.motion =
      differentiate(model, time, filterConfigurations(model, q, kDanceRate, kDanceCutoff));
  const PartRobot parts =
      splitContacts(clip.robot, {},
                    carried == Carried::Cones ? FrictionModel::Cone : FrictionModel::OuterPyramid);
  const ContactSchedule none{{}, ContactSchedule::Matrix(0, frames)};
  const ContactInference found =
      inferContacts(parts, computeContactMotions(parts.robot, clip.motion),
                    analyzeMotion(parts.robot, clip.motion, none), false);
  if (carried == Carried::Soles)
    clip.schedule = gatherParts(clip.robot, parts, found.schedule);
  else
    clip = {parts.robot, clip.motion, found.schedule};
  return clip;
}

// What one would do without.
struct Reference {
  // Of a frame, as the general solver takes it; no solver where no foot stands.
  struct Program {
    std::shared_ptr<Peer> solver;
    Eigen::VectorXd ce0;
  };

  explicit Reference(const Clip& clip)
      : model(clip.robot.getModel()), data(model), motion(clip.motion) {
    DynaCoM robot = clip.robot;
    for (Eigen::Index k = 0; k < kPrograms; ++k) {
      const Eigen::Index frame = k * motion.frames() / kPrograms;
      for (std::size_t i = 0; i < clip.schedule.names.size(); ++i) {
        if (clip.schedule.active(Eigen::Index(i), frame))
          robot.activateContact(clip.schedule.names[i]);
        else
          robot.deactivateContact(clip.schedule.names[i]);
      }
      programs.emplace_back();
      robot.computeDynamics(motion.q.col(frame), motion.v.col(frame), motion.a.col(frame));
      if (robot.getActiveContacts().empty()) continue;
      const DistributionStatus status = distribute(robot, groundWrench(robot));
      const QuadraticProgram program = makeProgram(robot);
      programs.back() = {makePeer("eiquadprog/plain"), program.ce0};
      programs.back().solver->prepare(program);
      const Eigen::VectorXd& forces = programs.back().solver->solve(program.ce0);
      if (status == DistributionStatus::Solved) requireSameForces(robot, forces);
    }
  }

  void run() {
    for (Eigen::Index frame = 0; frame < motion.frames(); ++frame) {
      pinocchio::computeCentroidalMomentumTimeVariation(model, data, motion.q.col(frame),
                                                        motion.v.col(frame), motion.a.col(frame));
      const Program& program = programs[std::size_t(frame % kPrograms)];
      if (program.solver) program.solver->solve(program.ce0);
    }
  }

  pinocchio::Model model;
  pinocchio::Data data;
  Motion motion;
  std::vector<Program> programs;
};

using MakeClip = std::function<Clip()>;

Case analysis(const std::string& name, const MakeClip& makeClip, const AnalysisSettings& settings,
              const std::string& reference) {
  const auto prepare = [=] {
    return [settings, clip = makeClip()] {
      analyzeMotion(clip.robot, clip.motion, clip.schedule, settings);
    };
  };
  return {name, prepare, reference};
}

// From what was recorded to the verdict, of many short clips.
Case examination(const std::string& name, int threads, const std::string& reference) {
  const auto prepare = [threads] {
    const Clip clip = makeSway(kClipFrames);
    const RecordedMotion recorded = {clip.motion.time, clip.motion.q};
    ExaminationSettings settings;
    settings.distance = false;  // whose time hangs on how much is out of reach
    settings.analysis.threads = threads;
    return [robot = clip.robot, recorded, settings] {
      std::size_t feasible = 0;
      analyzeMotions(
          robot, kClips, [&](std::size_t) { return recorded; },
          [&](std::size_t, const MotionExamination* found, const std::string& error) {
            if (!found) throw std::logic_error(error);
            feasible += found->verdict.isFeasible() ? 1 : 0;
          },
          settings);
      if (feasible != kClips) throw std::logic_error("clips that sway are feasible");
    };
  };
  return {name, prepare, reference};
}

std::string addReference(std::vector<Case>& cases, const std::string& name,
                         const MakeClip& makeClip) {
  std::string reference = "Pinocchio and eiquadprog/" + name;
  cases.push_back({reference, [makeClip] {
                     const auto all = std::make_shared<Reference>(makeClip());
                     return [all] { all->run(); };
                   }});
  return reference;
}

// In one thread, with each number of lanes that the machine has.
void addClip(std::vector<Case>& cases, const std::string& name, const MakeClip& makeClip,
             const std::string& reference) {
  const std::pair<int, const char*> variants[] = {{8, "avx512"}, {4, "avx2"}, {1, "scalar"}};
  for (const auto& [lanes, variant] : variants)
    if (countLanes(makeG1(), lanes) == lanes)
      cases.push_back(analysis("analyzeMotion/" + name + "/" + variant, makeClip,
                               makeSettings(1, lanes), reference));
}

}  // namespace

std::vector<Case> makeCases() {
  // Memory that one result has had is there for the next: what the kernel takes to clear pages says
  // more about the kernel.
  mallopt(M_MMAP_THRESHOLD, 1 << 30);
  mallopt(M_TRIM_THRESHOLD, 1 << 30);
  std::vector<Case> cases;
  const MakeClip sway = [] { return makeSway(kFrames); };
  addClip(cases, "sway", sway, addReference(cases, "sway", sway));
  if (std::ifstream(DYNACOM_DANCE)) {
    const auto dance = [](Carried carried) { return [=] { return readDance(carried); }; };
    const std::string reference = addReference(cases, "dance", dance(Carried::Soles));
    addClip(cases, "dance", dance(Carried::Soles), reference);
    addClip(cases, "dance, corners", dance(Carried::Pyramids), reference);
    addClip(cases, "dance, corners, cones", dance(Carried::Cones), reference);
  }
  const MakeClip makeLong = [] { return makeSway(kManyFrames); };
  const int lanes = kMaximalLanes;
  const std::string one = "analyzeMotion/1 thread", two = "analyzeMotion/2 threads";
  cases.push_back(analysis(one, makeLong, makeSettings(1, lanes), ""));
  cases.push_back(analysis(two, makeLong, makeSettings(2, lanes), one));
  const std::string one_by_one = "analyzeMotions/1 thread";
  cases.push_back(examination(one_by_one, 1, ""));
  cases.push_back(examination("analyzeMotions/2 threads", 2, one_by_one));
  return cases;
}

}  // namespace dynacom::benchmarks
