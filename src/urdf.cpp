// SPDX-License-Identifier: BSD-2-Clause
#include "urdf.hpp"

#include <console_bridge/console.h>
#include <pthread.h>
#include <urdf_parser/urdf_parser.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <mutex>
#include <pinocchio/multibody/joint.hpp>
#include <pinocchio/parsers/urdf.hpp>
#include <thread>

#include "check.hpp"

namespace dynacom::internal {

namespace {

// What others print goes to the handler that was there before.
struct Handler final : console_bridge::OutputHandler {
  void log(const std::string& message, console_bridge::LogLevel level, const char* file,
           int line) override {
    if (std::this_thread::get_id() != thread) {
      if (former && level >= former_level) former->log(message, level, file, line);
    } else if (level >= console_bridge::CONSOLE_BRIDGE_LOG_ERROR) {
      text += (text.empty() ? "" : "; ") + message;
    }
  }
  console_bridge::OutputHandler* former = nullptr;
  console_bridge::LogLevel former_level = console_bridge::CONSOLE_BRIDGE_LOG_NONE;
  std::thread::id thread;  // that reads
  std::string text;
};

// Takes what the URDF parser would print in this thread, for as long as it lives. What other
// threads print meanwhile by the same means goes where it would have gone.
//
// The parser's output is one for the whole process, so only one thread can have it at a time. A
// process is forked before or after that: in the copy nobody would give it back.
class ParserErrors {
 public:
  ParserErrors() : lock_(lockOutput()) {
    // There is a handler, and the one before it, which restoring exchanges.
    handler_.former = console_bridge::getOutputHandler();
    handler_.former_level = console_bridge::getLogLevel();
    handler_.thread = std::this_thread::get_id();
    handler_.text.clear();
    console_bridge::restorePreviousOutputHandler();
    before_ = console_bridge::getOutputHandler();
    console_bridge::useOutputHandler(&handler_);
    console_bridge::setLogLevel(
        std::min(handler_.former_level, console_bridge::CONSOLE_BRIDGE_LOG_ERROR));
  }
  ~ParserErrors() {
    console_bridge::setLogLevel(handler_.former_level);
    console_bridge::useOutputHandler(before_);
    console_bridge::useOutputHandler(handler_.former);
    handler_.thread = {};
  }
  ParserErrors(const ParserErrors&) = delete;
  ParserErrors& operator=(const ParserErrors&) = delete;

  const std::string& text() const { return handler_.text; }

 private:
  static std::unique_lock<std::mutex> lockOutput() {
    [[maybe_unused]] static const int registered =
        pthread_atfork([] { mutex_.lock(); }, [] { mutex_.unlock(); }, [] { mutex_.unlock(); });
    return std::unique_lock<std::mutex>(mutex_);
  }

  static inline Handler handler_;  // as long as the process, for who has asked for it meanwhile
  static inline std::mutex mutex_;
  std::unique_lock<std::mutex> lock_;
  console_bridge::OutputHandler* before_;
};

// The file's content. Reading it here, not in the parser, tells a missing file from a bad one.
std::string readFile(const std::string& path) {
  std::error_code error;
  if (std::filesystem::is_directory(path, error))
    throwInvalid("DynaCoMSettings.urdf must be a file or XML, got the directory '", path, "'");
  std::ifstream file(path);
  std::ostringstream content;
  if (!file || !(content << file.rdbuf()))
    throwInvalid("DynaCoMSettings.urdf: cannot read the file '", path, "'");
  return content.str();
}

// Whether the root joint moves nothing but a link without mass, which holds the robot by a floating
// joint of the file's own.
bool hasFloatingBase(const pinocchio::Model& model) {
  const auto& children = model.children[1];
  return model.inertias[1].mass() == 0. && children.size() == 1 &&
         model.joints[children[0]].shortname() == pinocchio::JointModelFreeFlyer::classname();
}

}  // namespace

bool isXml(const std::string& urdf) {
  const std::size_t first = urdf.find_first_not_of(" \t\r\n");
  return first != std::string::npos && urdf[first] == '<';
}

urdf::ModelInterfaceSharedPtr readUrdfTree(const std::string& urdf) {
  const std::string xml = isXml(urdf) ? urdf : readFile(urdf);
  const ParserErrors errors;
  const auto tree = ::urdf::parseURDF(xml);
  if (!tree) throwInvalid("urdf is not a robot's URDF: ", errors.text());
  return tree;
}

pinocchio::Model readUrdf(const std::string& urdf) {
  if (urdf.empty()) throwInvalid("DynaCoMSettings.urdf must be a file or XML, got ''");
  const bool is_xml = isXml(urdf);
  const std::string xml = is_xml ? urdf : readFile(urdf);
  const std::string source = is_xml ? "the XML given" : "'" + urdf + "'";

  pinocchio::Model model;
  const ParserErrors errors;
  try {
    pinocchio::urdf::buildModelFromXML(xml, pinocchio::JointModelFreeFlyer(), model);
    if (hasFloatingBase(model)) {
      model = pinocchio::Model();
      pinocchio::urdf::buildModelFromXML(xml, model);
      // Where a simulator would put the robot first: q shall be the base's pose in the world.
      model.jointPlacements[1].setIdentity();
    }
  } catch (const std::exception& error) {
    throwInvalid("DynaCoMSettings.urdf: ", source,
                 " is not a robot's URDF: ", errors.text().empty() ? error.what() : errors.text());
  }
  // The parser goes on after some errors, without the inertia that it could not read, for example.
  if (!errors.text().empty())
    throwInvalid("DynaCoMSettings.urdf: ", source, " has errors: ", errors.text());
  return model;
}

}  // namespace dynacom::internal
