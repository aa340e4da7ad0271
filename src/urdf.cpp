// SPDX-License-Identifier: BSD-2-Clause
#include "urdf.hpp"

#include <console_bridge/console.h>
#include <urdf_parser/urdf_parser.h>

#include <filesystem>
#include <fstream>
#include <mutex>
#include <pinocchio/multibody/joint.hpp>
#include <pinocchio/parsers/urdf.hpp>

#include "check.hpp"

namespace dynacom::internal {

namespace {

// Takes what the URDF parser would print, for as long as it lives. The parser's output is one for
// the whole process, so only one thread can have it at a time.
class ParserErrors {
 public:
  ParserErrors() : lock_(mutex_) {
    handler_.text.clear();
    console_bridge::useOutputHandler(&handler_);
  }
  ~ParserErrors() { console_bridge::restorePreviousOutputHandler(); }
  ParserErrors(const ParserErrors&) = delete;
  ParserErrors& operator=(const ParserErrors&) = delete;

  const std::string& text() const { return handler_.text; }

 private:
  struct Handler : console_bridge::OutputHandler {
    void log(const std::string& message, console_bridge::LogLevel level, const char*,
             int) override {
      if (level < console_bridge::CONSOLE_BRIDGE_LOG_ERROR) return;
      text += (text.empty() ? "" : "; ") + message;
    }
    std::string text;
  };

  // Of the process too: the parser keeps a pointer to it after it was replaced.
  static inline Handler handler_;
  static inline std::mutex mutex_;
  std::lock_guard<std::mutex> lock_;
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
