// SPDX-License-Identifier: BSD-2-Clause
// A thread takes a copy of a DynaCoM, and shares nothing. `scripts/test --sanitize` runs this with
// ThreadSanitizer, too.
#define BOOST_TEST_MODULE threads
#include <console_bridge/console.h>
#include <sys/wait.h>
#include <unistd.h>

#include <atomic>
#include <cstring>
#include <functional>
#include <limits>
#include <memory>
#include <thread>
#include <vector>

#include "dynacom/contact6d.hpp"
#include "dynacom/contact_point.hpp"
#include "dynacom/motion_verdict.hpp"
#include "feet.hpp"
#include "random_robot.hpp"

using namespace dynacom;
using namespace dynacom_tests;

namespace {

constexpr std::size_t kThreads = 8;
constexpr int kFrames = 60;

/// All numbers that came out, in the order in which they did.
using Numbers = std::vector<double>;

void append(Numbers& numbers, const Eigen::Ref<const MatrixXd>& values) {
  for (Index col = 0; col < values.cols(); ++col)
    for (Index row = 0; row < values.rows(); ++row) numbers.push_back(values(row, col));
}

/// Bit for bit, so that a NaN is the same as itself, and 0 is not −0.
bool sameBits(const Numbers& one, const Numbers& other) {
  return one.size() == other.size() &&
         std::memcmp(one.data(), other.data(), one.size() * sizeof(double)) == 0;
}

/// Calls an action with 0 ... 7, each in a thread of its own, and all of them at once.
void inThreads(const std::function<void(std::size_t)>& action) {
  std::atomic<std::size_t> ready{0};
  std::vector<std::thread> threads;
  for (std::size_t i = 0; i < kThreads; ++i)
    threads.emplace_back([&, i] {
      ++ready;
      while (ready < kThreads) std::this_thread::yield();
      action(i);
    });
  for (std::thread& thread : threads) thread.join();
}

/// A robot on two soles and two points, that has moved and has forces already.
DynaCoM makeRobot() {
  Random random(1);
  const auto model = standingRobot(random, stance(4));
  DynaCoM robot(model);
  for (int i = 0; i < 4; ++i) {
    const std::string frame = "sole" + std::to_string(i);
    if (i < 2)
      robot.addContact(makeSole(frame), frame);
    else
      robot.addContact(makePoint(frame), frame);
  }
  robot.setGroundHeight(-0.1);
  robot.setWrenchWeights((Vector6() << 1., 1., 1., 2., 2., 2.).finished());
  const State x = restState(model);
  robot.computeNL(3., x.q, x.v, x.a, Vector6::Zero(), false);
  return robot;
}

void appendResults(Numbers& numbers, DynaCoM& robot) {
  for (const Vector3d& value :
       {robot.getGroundCoMForce(), robot.getGroundCoMTorque(), robot.getCoM(), robot.getVCoM(),
        robot.getACoM(), robot.getAM(), robot.getAMVariation(), robot.getFeasibleACoM(),
        robot.getFeasibleAMVariation()})
    append(numbers, value);
  for (const Vector2d& value : {robot.getCoP(), robot.getVRP(), robot.getNL()})
    append(numbers, value);
  append(numbers, robot.allForces());
  append(numbers, robot.ne_A());
  const DistributionResult& result = robot.getDistribution();
  for (const Vector6& value :
       {result.wrench, result.achieved, result.residual, result.wrench_multipliers})
    append(numbers, value);
  for (const DistributionResult::Contact& contact : result.contacts) {
    append(numbers, contact.multipliers);
    append(numbers, contact.relaxation_multipliers);
  }
  numbers.insert(numbers.end(), {static_cast<double>(result.status), result.cost, result.scale,
                                 static_cast<double>(result.iterations)});
  for (const std::string& name : robot.getKnownContacts()) {
    append(numbers, robot.getContact(name)->getPose().toHomogeneousMatrix());
    append(numbers, robot.getContactCoP(name));
    numbers.insert(numbers.end(),
                   {robot.getContactFrictionUsage(name), robot.getContactCoPMargin(name),
                    robot.getContactYawUsage(name)});
  }
}

/// A motion of its own for each seed, in which everything happens that a controller does.
Numbers work(DynaCoM robot, unsigned seed) {
  Random random(seed);
  Numbers numbers;
  const std::vector<std::string> names = robot.getKnownContacts();
  for (int frame = 0; frame < kFrames; ++frame) {
    State x = randomState(robot.getModel(), random, 0.05);
    if (frame % 20 == 7) x.a[0] = std::numeric_limits<double>::quiet_NaN();
    robot.computeNL(3., x.q, x.v, x.a, random.vector(6, 5.), random.coin());
    appendResults(numbers, robot);

    // Wrenches in and out of reach.
    Vector3d force = random.vector3(300.);
    force.z() += 300.;
    robot.distributeForce(force, random.vector3(20.), comOf(robot.getModel(), x.q));
    appendResults(numbers, robot);
    if (frame % 10 == 0) {
      const WrenchMargin margin = robot.computeWrenchMargin();
      numbers.insert(numbers.end(), {margin.margin, static_cast<double>(margin.axis),
                                     static_cast<double>(margin.sign)});
    }

    // Contacts come and go, and change.
    const std::string& name = names[static_cast<std::size_t>(random.integer(0, 3))];
    const auto contact = robot.getContact(name);
    switch (random.integer(0, 3)) {
      case 0:
        robot.deactivateContact(name);
        break;
      case 1:
        robot.activateContact(name);
        break;
      case 2:
        robot.removeContact(name);
        robot.addContact(contact, name);
        break;
      default:
        if (const auto sole = std::dynamic_pointer_cast<Contact6D>(contact))
          sole->setMu(random.uniform(0.3, 0.9));
        robot.setMinimalVerticalForce(random.uniform(1., 100.));
    }
    if (frame % 20 == 19) robot = DynaCoM(robot);
  }
  return numbers;
}

/// Random states as a motion, on ground that is flat for even seeds, in which contacts come and go.
Numbers analyze(const DynaCoM& robot, std::size_t seed, Index frames, int threads) {
  Random random(static_cast<unsigned>(seed));
  const auto& model = robot.getModel();
  Motion motion;
  motion.time = VectorXd::LinSpaced(frames, 0., 1.);
  motion.q.resize(model.nq, frames);
  motion.v.resize(model.nv, frames);
  motion.a.resize(model.nv, frames);
  ContactSchedule schedule{robot.getKnownContacts(), ContactSchedule::Matrix(4, frames)};
  for (Index frame = 0; frame < frames; ++frame) {
    const State x = randomState(model, random, 0.05);
    motion.q.col(frame) = x.q;
    motion.v.col(frame) = x.v;
    motion.a.col(frame) = x.a;
    for (Index k = 0; k < 4; ++k) schedule.active(k, frame) = random.coin();
  }
  AnalysisSettings settings;
  settings.flat_horizontal_ground = seed % 2 == 0;
  settings.threads = threads;
  Index told = 0;
  settings.progress = [&told](Index done) { told = done; };
  const MotionAnalysis analysis = analyzeMotion(robot, motion, schedule, settings);
  Numbers numbers = {double(told)};
  append(numbers, analysis.residual);
  append(numbers, analysis.cop);
  append(numbers, analysis.nl);
  for (const auto& contact : analysis.contacts) append(numbers, contact.wrench);
  return numbers;
}

}  // namespace

BOOST_AUTO_TEST_CASE(copies_in_threads_do_what_they_do_one_after_the_other) {
  const DynaCoM robot = makeRobot();
  std::vector<Numbers> serial, parallel(kThreads);
  for (unsigned i = 0; i < kThreads; ++i) serial.push_back(work(robot, i));

  std::vector<DynaCoM> copies(kThreads, robot);
  inThreads(
      [&](std::size_t i) { parallel[i] = work(std::move(copies[i]), static_cast<unsigned>(i)); });
  for (std::size_t i = 0; i < kThreads; ++i) {
    BOOST_TEST(sameBits(parallel[i], serial[i]));
    // The motions are not all one.
    BOOST_TEST(!sameBits(serial[i], serial[(i + 1) % kThreads]));
  }
}

BOOST_AUTO_TEST_CASE(threads_may_copy_from_one_original) {
  const DynaCoM robot = makeRobot();
  const DynaCoM untouched(robot);
  std::vector<Numbers> parallel(kThreads);
  inThreads([&](std::size_t i) { parallel[i] = work(robot, static_cast<unsigned>(i)); });
  for (unsigned i = 0; i < kThreads; ++i) BOOST_TEST(sameBits(parallel[i], work(untouched, i)));
}

BOOST_AUTO_TEST_CASE(threads_may_analyze_motions_of_one_robot) {
  const DynaCoM robot = makeRobot();
  std::vector<Numbers> parallel(kThreads);
  inThreads([&](std::size_t i) { parallel[i] = analyze(robot, i, kFrames, 1); });
  for (std::size_t i = 0; i < kThreads; ++i)
    BOOST_TEST(sameBits(parallel[i], analyze(robot, i, kFrames, 1)));
}

BOOST_AUTO_TEST_CASE(an_analysis_has_threads_of_its_own) {
  const DynaCoM robot = makeRobot();
  for (const std::size_t i : {0, 1}) {
    const Numbers serial = analyze(robot, i, 1500, 1);
    for (const int threads : {2, 4, 8})
      BOOST_TEST(sameBits(analyze(robot, i, 1500, threads), serial));
  }
}

BOOST_AUTO_TEST_CASE(contacts_and_verdicts_are_the_same_whatever_the_number_of_threads) {
  const DynaCoM robot = makeRobot();
  const auto& model = robot.getModel();
  const Index frames = 1000;
  Random random(3);
  Motion motion{VectorXd::LinSpaced(frames, 0., 10.), MatrixXd(model.nq, frames),
                MatrixXd(model.nv, frames), MatrixXd(model.nv, frames)};
  ContactSchedule schedule{robot.getKnownContacts(), ContactSchedule::Matrix(4, frames)};
  for (Index frame = 0; frame < frames; ++frame) {
    const State x = randomState(model, random, 0.1);
    motion.q.col(frame) = x.q;
    motion.v.col(frame) = x.v;
    motion.a.col(frame) = 3. * x.a;
    for (Index k = 0; k < 4; ++k) schedule.active(k, frame) = random.integer(0, 3) == 0;
  }
  const MotionAnalysis analysis = analyzeMotion(robot, motion, schedule);
  const auto judge = [&](int threads) {
    Numbers numbers;
    const auto contacts = computeContactMotions(robot, motion, threads);
    for (const ContactMotion& contact : contacts) {
      append(numbers, contact.position);
      append(numbers, contact.rotation);
      append(numbers, contact.height);
      append(numbers, contact.velocity);
    }
    // It was recorded as standing still: else all frames were near jumps.
    const RecordedMotion recorded{motion.time, motion.q.col(0).replicate(1, motion.frames())};
    const MotionVerdict verdict =
        judgeMotion(robot, motion, recorded, contacts, VectorXd::Zero(4), analysis, {}, threads);
    for (const MotionFinding& finding : verdict.findings) append(numbers, finding.measured);
    BOOST_TEST(verdict[MotionFault::CoPOutside].frames > 50);
    return numbers;
  };
  const Numbers serial = judge(1);
  for (const int threads : {2, 3, 8}) BOOST_TEST(sameBits(judge(threads), serial));
}

namespace {

DynaCoMSettings makeBall() {
  DynaCoMSettings settings;
  settings.urdf =
      R"(<robot name="ball"><link name="ball"><inertial><mass value="2.5"/><inertia
      ixx="0.1" ixy="0" ixz="0" iyy="0.1" iyz="0" izz="0.1"/></inertial></link></robot>)";
  return settings;
}

/// Counts what is printed by the parser's means.
struct Counter : console_bridge::OutputHandler {
  void log(const std::string&, console_bridge::LogLevel, const char*, int) override { ++messages; }
  std::atomic<int> messages{0};
};

/// Counters in the place of the process's output, for as long as this lives.
struct Output {
  Output() {
    console_bridge::useOutputHandler(&before);
    console_bridge::useOutputHandler(&present);
  }
  ~Output() {
    console_bridge::useOutputHandler(former);
    console_bridge::useOutputHandler(former);
  }
  console_bridge::OutputHandler* const former = console_bridge::getOutputHandler();
  Counter before, present;
};

}  // namespace

BOOST_AUTO_TEST_CASE(the_output_of_others_is_theirs_while_robots_are_read) {
  Output output;
  DynaCoMSettings good = makeBall();  // with so many links that reading takes its time
  std::string links;
  for (int k = 0; k < 300; ++k) {
    const std::string name = "link" + std::to_string(k);
    links += "<link name='" + name + "'/><joint name='to_" + name +
             "' type='fixed'><parent link='ball'/><child link='" + name + "'/></joint>";
  }
  good.urdf.insert(good.urdf.find("</robot>"), links);
  std::atomic<bool> ends{false};
  std::atomic<int> printed{0};
  std::thread other([&] {
    while (!ends) {
      CONSOLE_BRIDGE_logError("something else is wrong");
      ++printed;
    }
  });
  while (printed == 0) std::this_thread::yield();
  int refused = 0;
  for (int repetition = 0; repetition < 20; ++repetition) {
    try {
      DynaCoM robot(good);
    } catch (const std::invalid_argument&) {
      ++refused;
    }
  }
  ends = true;
  other.join();
  BOOST_TEST(refused == 0);
  BOOST_TEST(output.present.messages + output.before.messages == printed);
}

BOOST_AUTO_TEST_CASE(the_output_is_what_it_was_after_a_robot_was_read) {
  Output output;
  const auto level = console_bridge::getLogLevel();
  DynaCoMSettings good = makeBall(), bad = good;
  bad.urdf = good.urdf.substr(0, 60);
  for (const bool is_good : {true, false}) {
    try {
      DynaCoM robot(is_good ? good : bad);
    } catch (const std::invalid_argument&) {
      BOOST_TEST(!is_good);
    }
    BOOST_TEST(console_bridge::getOutputHandler() == &output.present);
    console_bridge::restorePreviousOutputHandler();
    BOOST_TEST(console_bridge::getOutputHandler() == &output.before);
    console_bridge::restorePreviousOutputHandler();
  }
  BOOST_TEST(output.present.messages == 0);
  // Nor does it matter whether anything is printed at all.
  console_bridge::setLogLevel(console_bridge::CONSOLE_BRIDGE_LOG_NONE);
  bad.urdf = good.urdf;
  bad.urdf.replace(bad.urdf.find("2.5"), 3, "two");
  BOOST_CHECK_THROW(DynaCoM{bad}, std::invalid_argument);
  BOOST_TEST(console_bridge::getLogLevel() == console_bridge::CONSOLE_BRIDGE_LOG_NONE);
  console_bridge::setLogLevel(level);
}

BOOST_AUTO_TEST_CASE(a_process_that_was_forked_while_a_robot_is_read_reads_robots) {
  const DynaCoMSettings good = makeBall();
  std::atomic<bool> ends{false};
  std::thread other([&] {
    while (!ends) DynaCoM robot(good);
  });
  int failed = 0;
  for (int trial = 0; trial < 30 && failed == 0; ++trial) {
    const pid_t child = fork();
    if (child == 0) {
      alarm(20);
      _exit(DynaCoM(good).getMass() == 2.5 ? 0 : 1);
    }
    int status = -1;
    if (waitpid(child, &status, 0) != child || status != 0) ++failed;
  }
  ends = true;
  other.join();
  BOOST_TEST(failed == 0);
}

BOOST_AUTO_TEST_CASE(threads_may_read_robots_at_once) {
  // The parser has one output for the whole process, so that this is less obvious than it looks.
  DynaCoMSettings good = makeBall(), bad;
  bad.urdf = R"(<robot name="ball"><link name="ball"><inertial>)";
  std::vector<double> masses(kThreads);
  std::vector<int> refused(kThreads);
  inThreads([&](std::size_t i) {
    for (int repetition = 0; repetition < 20; ++repetition) {
      DynaCoM robot(good);
      try {
        robot.initialize(bad);
      } catch (const std::invalid_argument&) {
        ++refused[i];
      }
      masses[i] = robot.getMass();
    }
  });
  for (std::size_t i = 0; i < kThreads; ++i) {
    BOOST_TEST(masses[i] == 2.5);
    BOOST_TEST(refused[i] == 20);
  }
}
