// SPDX-License-Identifier: BSD-2-Clause
// What runs in a control loop calls the system for nothing: the kernel itself watches a thread that
// runs one, with all memory locked, and allows it no system call but to end. Memory that a thread
// takes for the first time, a lock that another thread holds, and anything printed are such calls.
// What needs none is counted: allocations, mutexes and locks that are free, static variables that
// are initialised, exceptions. What is locked by an atomic variable of its own is not seen.
#define BOOST_TEST_MODULE realtime
#include <dlfcn.h>
#include <linux/audit.h>
#include <linux/filter.h>
#include <linux/seccomp.h>
#include <pthread.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <boost/test/framework.hpp>
#include <boost/test/results_collector.hpp>
#include <cerrno>
#include <cmath>
#include <csignal>
#include <cstddef>
#include <cstdio>
#include <cstring>
#include <functional>
#include <mutex>
#include <shared_mutex>
#include <stdexcept>

#include "asked_solvers.hpp"
#include "dynacom/contact6d.hpp"
#include "dynacom/contact_point.hpp"
#include "dynacom/dyna_com.hpp"
#include "feet.hpp"
#include "malloc_counter.hpp"
#include "random_robot.hpp"

#if defined(__x86_64__)
#define DYNACOM_AUDIT_ARCH AUDIT_ARCH_X86_64
#elif defined(__aarch64__)
#define DYNACOM_AUDIT_ARCH AUDIT_ARCH_AARCH64
#endif

using namespace dynacom;
using namespace dynacom_tests;

namespace {

std::atomic<int> locks{0}, exceptions{0};

/// Finds the library's function, the first time.
template <class Function>
Function* find(Function*& original, const char* name) {
  // Not as a static variable of the caller's, whose initialisation is one of the calls below.
  if (!original) original = reinterpret_cast<Function*>(dlsym(RTLD_NEXT, name));
  return original;
}

}  // namespace

// As those of malloc_counter.hpp, these take the place of the libraries'.
extern "C" {
#define VISIBLE __attribute__((visibility("default")))

VISIBLE int pthread_mutex_lock(pthread_mutex_t* mutex) noexcept {
  static int (*original)(pthread_mutex_t*) = nullptr;
  if (counting) ++locks;
  return find(original, "pthread_mutex_lock")(mutex);
}

VISIBLE int pthread_rwlock_rdlock(pthread_rwlock_t* lock) noexcept {
  static int (*original)(pthread_rwlock_t*) = nullptr;
  if (counting) ++locks;
  return find(original, "pthread_rwlock_rdlock")(lock);
}

VISIBLE int pthread_rwlock_wrlock(pthread_rwlock_t* lock) noexcept {
  static int (*original)(pthread_rwlock_t*) = nullptr;
  if (counting) ++locks;
  return find(original, "pthread_rwlock_wrlock")(lock);
}

// The compiler has declarations of its own of these. The first initialises a function's static
// variable, which other threads wait for.
VISIBLE int countInitialisation(void* guard) __asm__("__cxa_guard_acquire");
VISIBLE void countThrow(void* exception, void* type,
                        void (*destructor)(void*)) __asm__("__cxa_throw");
VISIBLE void countRethrow() __asm__("__cxa_rethrow");

int countInitialisation(void* guard) {
  static int (*original)(void*) = nullptr;
  if (counting) ++locks;
  return find(original, "__cxa_guard_acquire")(guard);
}

void countThrow(void* exception, void* type, void (*destructor)(void*)) {
  static void (*original)(void*, void*, void (*)(void*)) = nullptr;
  if (counting) ++exceptions;
  find(original, "__cxa_throw")(exception, type, destructor);
}

void countRethrow() {
  static void (*original)() = nullptr;
  if (counting) ++exceptions;
  find(original, "__cxa_rethrow")();
}

#undef VISIBLE
}

namespace {

// --- The watch -------------------------------------------------------------------------------

/// What became of a thread under watch, in memory that parent and child share.
struct Report {
  bool watched = false;       ///< whether the kernel watches
  int refusal = 0;            ///< why it does not, an errno
  bool locked = false;        ///< whether all memory is locked
  bool finished = false;      ///< whether the action came to its end
  long system_call = -1;      ///< the first that was made
  const char* step = "none";  ///< in the middle of what
  int allocations = 0, locks = 0, exceptions = 0;
};

Report* report = nullptr;
std::function<void()> watched_action;

/// Asks the kernel to send SIGSYS to this thread at any system call but those that end it.
bool watchThisThread() {
#ifdef DYNACOM_AUDIT_ARCH
  std::array<sock_filter, 7> program = {{
      BPF_STMT(BPF_LD | BPF_W | BPF_ABS, offsetof(seccomp_data, arch)),
      BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, DYNACOM_AUDIT_ARCH, 0, 3),
      BPF_STMT(BPF_LD | BPF_W | BPF_ABS, offsetof(seccomp_data, nr)),
      BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, __NR_exit_group, 2, 0),
      BPF_STMT(BPF_RET | BPF_K, SECCOMP_RET_TRAP),
      BPF_STMT(BPF_RET | BPF_K, SECCOMP_RET_KILL),
      BPF_STMT(BPF_RET | BPF_K, SECCOMP_RET_ALLOW),
  }};
  sock_fprog filter = {static_cast<unsigned short>(program.size()), program.data()};
  return prctl(PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0) == 0 &&
         prctl(PR_SET_SECCOMP, SECCOMP_MODE_FILTER, &filter) == 0;
#else
  errno = ENOSYS;
  return false;
#endif
}

void reportSystemCall(int, siginfo_t* info, void*) {
  report->system_call = info->si_syscall;
  syscall(__NR_exit_group, 0);
}

void* runUnderWatch(void*) {
  // Nothing of the C library that may allocate or lock for a thread that is new.
  report->watched = watchThisThread();
  report->refusal = report->watched ? 0 : errno;
  allocations = locks = exceptions = 0;
  counting = true;
  watched_action();
  counting = false;
  report->allocations = allocations;
  report->locks = locks;
  report->exceptions = exceptions;
  report->finished = true;
  syscall(__NR_exit_group, 0);
  return nullptr;
}

/// Runs an action in a thread of its own of a process of its own, with all memory locked if that is
/// permitted, and under the kernel's watch if it offers that.
Report watch(const std::function<void()>& action) {
  void* const shared =
      mmap(nullptr, sizeof(Report), PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0);
  BOOST_REQUIRE(shared != MAP_FAILED);
  report = new (shared) Report;
  const pid_t child = fork();
  if (child == 0) {
    alarm(120);  // if it never comes to an end
    struct sigaction handler = {};
    handler.sa_sigaction = reportSystemCall;
    handler.sa_flags = SA_SIGINFO;
    sigaction(SIGSYS, &handler, nullptr);
    report->locked = mlockall(MCL_CURRENT | MCL_FUTURE) == 0;
    watched_action = action;
    pthread_t thread;
    if (pthread_create(&thread, nullptr, runUnderWatch, nullptr) == 0)
      pthread_join(thread, nullptr);
    _exit(1);
  }
  BOOST_REQUIRE(child > 0);
  int status = 0;
  while (waitpid(child, &status, 0) < 0) BOOST_REQUIRE(errno == EINTR);
  const Report result = *report;
  report = nullptr;
  munmap(shared, sizeof(Report));
  BOOST_TEST((WIFEXITED(status) && WEXITSTATUS(status) == 0),
             "the process ended with status " << status << " during " << result.step);
  return result;
}

std::string nameOf(long system_call) {
  switch (system_call) {
    case -1:
      return "none";
    case __NR_mmap:
      return "mmap";
    case __NR_munmap:
      return "munmap";
    case __NR_mprotect:
      return "mprotect";
    case __NR_madvise:
      return "madvise";
    case __NR_brk:
      return "brk";
    case __NR_futex:
      return "futex";
    case __NR_write:
      return "write";
    case __NR_openat:
      return "openat";
    default:
      return "number " + std::to_string(system_call);
  }
}

/// Whether an action under watch came to its end without any system call; else, which it made.
boost::test_tools::predicate_result isSilent(const Report& report) {
  boost::test_tools::predicate_result result(report.finished && report.system_call == -1);
  if (!result)
    result.message() << "\nthe system call was '" << nameOf(report.system_call) << "', during "
                     << report.step;
  return result;
}

/// Says at the end what was not permitted here, unless something has failed: without the kernel's
/// watch, calls that can be counted were, and no more. CMakeLists.txt knows these words.
struct SayWhatIsMissing {
  ~SayWhatIsMissing() {
    using namespace boost::unit_test;
    if (!results_collector.results(framework::master_test_suite().p_id).passed()) return;
    if (refusal != 0) std::printf("NOT DONE: no watch by seccomp (%s)\n", std::strerror(refusal));
    if (!locked) std::printf("without mlockall(), which is not permitted here\n");
  }

  static int refusal;
  static bool locked;
};
int SayWhatIsMissing::refusal = 0;
bool SayWhatIsMissing::locked = true;

// --- A control loop --------------------------------------------------------------------------

/// A robot on two soles and two points, with two of each more that take no part at first, and all
/// that its control loop is going to meet.
class ControlLoop {
 public:
  ControlLoop() : random_(1), model_(standingRobot(random_, stance(4))), dynacom_(model_) {
    for (int i = 0; i < 4; ++i) {
      const std::string frame = "sole" + std::to_string(i);
      for (const bool active : {true, false}) {
        names_.push_back("the contact at " + frame + (active ? ", active at first" : ""));
        if ((i < 2) == active)
          dynacom_.addContact(makeSole(frame), names_.back(), active);
        else
          dynacom_.addContact(makePoint(frame), names_.back(), active);
      }
    }
    for (int i = 0; i < 40; ++i) {
      motions_.push_back(randomState(model_, random_, 0.02));
      data_.emplace_back(model_);
      runCentroidalDynamics(model_, data_.back(), motions_.back());
    }
    external_ = random_.vector(6, 2.);
    findWrenches();
  }

  /// Each status, and each solver, is asked for in a tick. Returns how often each status came out.
  std::array<int, 5> run() {
    std::array<int, 5> counts{};
    const auto count = [&] {
      ++counts[static_cast<std::size_t>(dynacom_.getDistributionStatus())];
    };
    for (std::size_t tick = 0; tick < motions_.size(); ++tick) {
      const State& x = motions_[tick];
      begin("computeDynamics(q, v, a)");
      dynacom_.computeDynamics(x.q, x.v, x.a);
      begin("computeDynamics(q, v, a) on uneven ground");
      dynacom_.computeDynamics(x.q, x.v, x.a, external_, false);
      count();
      begin("computeDynamics(data)");
      dynacom_.computeDynamics(data_[tick]);
      begin("computeDynamics(data) on uneven ground");
      dynacom_.computeDynamics(data_[tick], external_, false);
      count();
      begin("computeNL");
      dynacom_.computeNL(3.);
      dynacom_.computeNL(3., x.q, x.v, x.a, external_, tick % 2 == 0);
      begin("computeNL on a plane");
      dynacom_.computeNL(3., x.q, x.v, x.a, external_,
                         GroundPlane{Vector3d::Zero(), Vector3d(0.1, 0.2, 3.)});
      begin("distributeForce in reach");
      distribute(groundWrench());
      count();
      begin("distributeForce out of reach");
      distribute(-groundWrench());
      count();
      begin("distributeForce of numbers that are not finite");
      distribute(Vector6::Constant(std::nan("")));
      count();
      begin("distributeForce beyond the largest numbers");
      distribute(Vector6::Constant(1e308));
      count();
      begin("distributeForce of nothing");
      distribute(Vector6::Zero());
      count();
      begin("setContactPose");
      dynacom_.setContactPose(names_[tick % names_.size()], poses_[tick % poses_.size()]);
      distribute(groundWrench());
      begin("resetContactPose");
      dynacom_.resetContactPose(names_[tick % names_.size()]);
      begin("activateContact");
      dynacom_.activateContact(names_[(3 * tick + 1) % names_.size()]);
      distribute(groundWrench());
      begin("deactivateContact");
      dynacom_.deactivateContact(names_[5 * tick % names_.size()]);
      distribute(groundWrench());
      begin("settings");
      dynacom_.setWarmStart(tick % 4 > 0);
      dynacom_.setMaximalIterations(tick % 3 > 0 ? WrenchDistribution::kMaximalIterations : 2);
      dynacom_.setWrenchWeights(Vector6::Ones());
      dynamic_cast<Contact6D&>(*dynacom_.getContact(names_[0])).setMu(0.5 + 0.01 * double(tick));
      distribute(groundWrench());
      dynacom_.setMaximalIterations(WrenchDistribution::kMaximalIterations);
      begin("getters");
      sum_ += read();
    }
    begin("computeDynamics of numbers that are not finite");
    dynacom_.computeNL(3., invalid_.q, invalid_.v, invalid_.a, external_, true);
    dynacom_.computeNL(3., invalid_.q, invalid_.v, invalid_.a, external_, false);
    count();
    begin("wrenches for the robust solvers");
    dynacom_.setWarmStart(false);
    place();
    dynacom_.setWrenchWeights(far_apart_);
    for (const Vector6& wrench : next_to_boundary_) {
      distribute(wrench);
      count();
    }
    dynacom_.setWrenchWeights(Vector6::Ones());
    begin("no contact");
    for (const std::string& name : names_) dynacom_.deactivateContact(name);
    distribute(-groundWrench());
    distribute(next_to_boundary_.front());
    count();
    begin("the end");
    return counts;
  }

  /// How many solvers are asked for the wrenches next to the boundary: none, 1, 2, 3.
  std::array<int, 4> askedSolvers() {
    std::array<int, 4> asked{};
    dynacom_.setWarmStart(false);
    place();
    dynacom_.setWrenchWeights(far_apart_);
    for (const Vector6& wrench : next_to_boundary_) {
      distribute(wrench);
      ++asked[static_cast<std::size_t>(countAskedSolvers(dynacom_.getDistribution()))];
    }
    return asked;
  }

 private:
  void begin(const char* step) {
    if (report) report->step = step;
  }

  void distribute(const Vector6& wrench) {
    dynacom_.distributeForce(wrench.head<3>(), wrench.tail<3>(), dynacom_.getCoM());
  }

  Vector6 groundWrench() const {
    Vector6 wrench;
    wrench << dynacom_.getGroundCoMForce(), dynacom_.getGroundCoMTorque();
    return wrench;
  }

  /// All contacts and no other settings than at first, at rest, where the feet are level.
  void place() {
    for (const std::string& name : names_) dynacom_.activateContact(name);
    dynamic_cast<Contact6D&>(*dynacom_.getContact(names_[0])).setMu(0.7);
    dynacom_.computeDynamics(rest_.q, rest_.v, rest_.a);
  }

  void findWrenches() {
    rest_ = invalid_ = restState(model_);
    invalid_.v[0] = std::nan("");
    for (int i = 0; i < 5; ++i) {
      poses_.push_back(random_.placement(0.1));
      poses_.back().rotation().setIdentity();
    }
    DynaCoM placed = dynacom_;
    placed.computeDynamics(rest_.q, rest_.v, rest_.a);
    // On the same facet of friction in all contacts, but for very little.
    for (int i = 0; i < 60; ++i) {
      const double beyond = std::pow(10., -4. - 0.15 * i) * (i % 2 == 0 ? 1. : -1.);
      Vector6 wrench = Vector6::Zero();
      for (const std::string& name : names_) {
        const auto& ne = placed.getContact(name)->ne_A();
        wrench += random_.uniform(50., 200.) *
                  (ne.col(2) + 0.7 * (1. + beyond) * ne.col(0) + 0.3 * ne.col(1));
      }
      next_to_boundary_.push_back(wrench);
    }
  }

  double read() const {
    double sum = dynacom_.getMass() + dynacom_.getCoM().x() + dynacom_.getVCoM().x() +
                 dynacom_.getACoM().x() + dynacom_.getAM().x() + dynacom_.getAMVariation().x() +
                 dynacom_.getGroundCoMForce().x() + dynacom_.getGroundCoMTorque().x() +
                 dynacom_.getCoP().x() + dynacom_.getVRP().x() + dynacom_.getNL().x() +
                 dynacom_.getCoP3D().x() + dynacom_.getVRP3D().x() + dynacom_.getECMP().x() +
                 dynacom_.getCMP(GroundPlane()).x() + dynacom_.getZMP(GroundPlane()).x() +
                 dynacom_.getFeasibleACoM().x() + dynacom_.getFeasibleAMVariation().x() +
                 dynacom_.ne_b()[0] + dynacom_.getDistribution().residual[0] +
                 dynacom_.getDistribution().isOptimal();
    for (const std::string& name : names_) {
      const ContactBase& contact = *dynacom_.getContact(name);
      sum += contact.appliedForce()[2] + contact.ne_A()(0, 0) + contact.toWorldForces()[0] +
             contact.toCoMForces()[0] + contact.getSurfacePose().translation().x() +
             dynacom_.getContactCoP(name).x() + dynacom_.getContactFrictionUsage(name) +
             dynacom_.getContactCoPMargin(name) + dynacom_.getContactYawUsage(name);
    }
    return sum;
  }

  Random random_;
  pinocchio::Model model_;
  DynaCoM dynacom_;
  std::vector<std::string> names_;
  std::vector<State> motions_;
  std::vector<pinocchio::Data> data_;
  State rest_, invalid_;
  Vector6 external_;
  std::vector<SE3> poses_;
  std::vector<Vector6> next_to_boundary_;
  // With weights so far apart, rounding decides what is next to the boundary.
  const Vector6 far_apart_ = (Vector6() << 1., 1., 1., 1e4, 1e4, 1e4).finished();
  double sum_ = 0.;
};

double staticNumber() {
  static const double number = std::nextafter(double(getpid()), 0.);
  return number;
}

void useMemory(std::size_t size) {
  static volatile char* memory = nullptr;
  memory = static_cast<char*>(std::malloc(size));
  memory[0] = 1;
}

}  // namespace

BOOST_GLOBAL_FIXTURE(SayWhatIsMissing);

// --- The watch can fail ----------------------------------------------------------------------

BOOST_AUTO_TEST_CASE(what_calls_the_system_is_caught) {
  const Report nothing = watch([] {});
  BOOST_TEST(isSilent(nothing));
  SayWhatIsMissing::refusal = nothing.refusal;
  SayWhatIsMissing::locked = nothing.locked;
  if (!nothing.watched) return;
  const auto isCaught = [](long system_call, const std::function<void()>& action) {
    const Report result = watch([&] {
      report->step = "what must be caught";
      action();
    });
    BOOST_TEST(!isSilent(result));
    BOOST_TEST(!result.finished);
    BOOST_TEST(result.system_call == system_call,
               "caught " << nameOf(result.system_call) << " instead of " << nameOf(system_call));
    BOOST_TEST(std::string(result.step) == "what must be caught");
  };
  isCaught(__NR_mmap, [] { mmap(nullptr, 4096, PROT_READ, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0); });
  isCaught(__NR_brk, [] { sbrk(4096); });
  isCaught(__NR_mmap, [] { useMemory(1 << 20); });
  isCaught(__NR_mmap, [] { useMemory(8); });  // a new thread has none
  isCaught(__NR_write, [] { std::fprintf(stderr, "this is never seen\n"); });
  std::mutex mutex;
  mutex.lock();  // in the child, too
  isCaught(__NR_futex, [&] { mutex.lock(); });
  mutex.unlock();
  // What the library does not promise is seen in it, too.
  DynaCoM dynacom(singleBody(10., stance(2)));
  dynacom.addContact(makeSole("sole0"), "left");
  isCaught(__NR_mmap, [&] { dynacom.getActiveContacts(); });
  isCaught(__NR_mmap, [&] { dynacom.uni_A(); });
  const std::string name = "right";
  isCaught(__NR_mmap, [&] { dynacom.activateContact(name); });  // an exception
}

BOOST_AUTO_TEST_CASE(what_calls_nobody_is_counted) {
  const auto count = [](const std::function<void()>& action) {
    allocations = locks = exceptions = 0;
    counting = true;
    action();
    counting = false;
    return std::array<int, 2>{locks, exceptions};
  };
  using Counts = std::array<int, 2>;
  BOOST_TEST((count([] {}) == Counts{0, 0}));
  std::mutex mutex;
  std::shared_mutex shared_mutex;
  BOOST_TEST((count([&] { std::lock_guard<std::mutex> lock(mutex); }) == Counts{1, 0}));
  BOOST_TEST(
      (count([&] { std::shared_lock<std::shared_mutex> lock(shared_mutex); }) == Counts{1, 0}));
  BOOST_TEST(
      (count([&] { std::unique_lock<std::shared_mutex> lock(shared_mutex); }) == Counts{1, 0}));
  BOOST_TEST((count([] { staticNumber(); }) == Counts{1, 0}));
  BOOST_TEST((count([] { staticNumber(); }) == Counts{0, 0}));
  BOOST_TEST(count([] {
               try {
                 throw std::runtime_error("here");
               } catch (const std::runtime_error&) {
               }
             })[1] == 1);
  // In the library.
  DynaCoM dynacom;
  const std::string name = "unknown";
  BOOST_TEST(count([&] {
               try {
                 dynacom.activateContact(name);
               } catch (const std::invalid_argument&) {
               }
             })[1] == 1);
}

// --- The control loop ------------------------------------------------------------------------

BOOST_AUTO_TEST_CASE(a_control_loop_calls_nobody) {
  ControlLoop loop;
  const auto asked = ControlLoop(loop).askedSolvers();
  BOOST_TEST(asked[0] == 0);
  BOOST_TEST(asked[2] + asked[3] > 10);
  BOOST_TEST(asked[3] > 5);

  // A copy, so that each tick is the first of its kind.
  ControlLoop copy = loop;
  std::array<int, 5> counts{};
  allocations = locks = exceptions = 0;
  counting = true;
  counts = copy.run();
  counting = false;
  BOOST_TEST(allocations == 0);
  BOOST_TEST(locks == 0);
  BOOST_TEST(exceptions == 0);
  const auto at = [&](DistributionStatus status) {
    return counts[static_cast<std::size_t>(status)];
  };
  BOOST_TEST(at(DistributionStatus::Solved) > 40);
  BOOST_TEST(at(DistributionStatus::Relaxed) > 40);
  BOOST_TEST(at(DistributionStatus::NoContact) == 1);
  BOOST_TEST(at(DistributionStatus::InvalidInput) > 40);
  BOOST_TEST(at(DistributionStatus::NumericalFailure) >= 40);
}

BOOST_AUTO_TEST_CASE(a_control_loop_makes_no_system_call) {
  ControlLoop loop;
  const Report result = watch([&] { loop.run(); });
  BOOST_TEST(isSilent(result));
  BOOST_TEST(result.allocations == 0);
  BOOST_TEST(result.locks == 0);
  BOOST_TEST(result.exceptions == 0);
  BOOST_TEST(std::string(result.step) == "the end");
}
