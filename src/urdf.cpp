// SPDX-License-Identifier: BSD-2-Clause
#include "urdf.hpp"

#include <filesystem>
#include <fstream>
#include <pinocchio/multibody/joint.hpp>
#include <pinocchio/parsers/urdf.hpp>

#include "check.hpp"

namespace dynacom::internal {

namespace {

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

bool isXml(const std::string& urdf) {
  const std::size_t first = urdf.find_first_not_of(" \t\r\n");
  return first != std::string::npos && urdf[first] == '<';
}

}  // namespace

pinocchio::Model readUrdf(const std::string& urdf) {
  if (urdf.empty()) throwInvalid("DynaCoMSettings.urdf must be a file or XML, got ''");
  const bool is_xml = isXml(urdf);
  pinocchio::Model model;
  try {
    pinocchio::urdf::buildModelFromXML(is_xml ? urdf : readFile(urdf),
                                       pinocchio::JointModelFreeFlyer(), model);
  } catch (const std::exception& error) {
    throwInvalid("DynaCoMSettings.urdf: ", is_xml ? "the XML given" : "'" + urdf + "'",
                 " is not a robot's URDF (", error.what(), ")");
  }
  return model;
}

}  // namespace dynacom::internal
