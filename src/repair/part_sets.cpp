// SPDX-License-Identifier: BSD-2-Clause
#include "part_sets.hpp"

#include <algorithm>

#include "../check.hpp"
#include "../inference/cone_projection.hpp"
#include "dynacom/contact_point.hpp"

namespace dynacom::internal {

std::vector<std::uint32_t> listSets(const std::vector<PartRobot::Part>& parts,
                                    const ContactSchedule& schedule, Eigen::Index frames) {
  if (parts.size() > ConeProjection::kMaximalPoints)
    throwInvalid("contacts must have at most ", ConeProjection::kMaximalPoints, " parts, got ",
                 parts.size());
  schedule.validate(frames);
  std::vector<std::uint32_t> sets(static_cast<std::size_t>(frames), 0);
  for (std::size_t row = 0; row < schedule.names.size(); ++row) {
    const auto part = std::find_if(parts.begin(), parts.end(), [&](const PartRobot::Part& other) {
      return other.name == schedule.names[row];
    });
    if (part == parts.end())
      throwInvalid("schedule names '", schedule.names[row], "', which is no part");
    const std::uint32_t bit = std::uint32_t(1) << (part - parts.begin());
    for (Eigen::Index frame = 0; frame < frames; ++frame)
      if (schedule.active(Eigen::Index(row), frame)) sets[static_cast<std::size_t>(frame)] |= bit;
  }
  return sets;
}

std::vector<Section> listFriction(const ContactSplit& parts) {
  std::vector<Section> friction;
  for (const FixedContact& fixed : parts.carrier.contacts) {
    const auto* point = dynamic_cast<const ContactPoint*>(fixed.contact.get());
    if (!point) throwInvalid("part '", fixed.name, "' must be a ContactPoint");
    const ContactPointSettings& settings = point->getSettings();
    friction.push_back(settings.makeFriction(settings.mu));
  }
  return friction;
}

std::vector<Section> scale(const std::vector<Section>& friction, double factor) {
  std::vector<Section> scaled;
  for (const Section& section : friction) {
    if (section.shape() == Section::Shape::Disc)
      scaled.push_back(Section::disc(factor * section.radius()));
    else if (section.shape() == Section::Shape::Polygon)
      scaled.push_back(Section::polygon(factor * section.vertices()));
    else
      scaled.push_back(Section::rectangle(factor * section.lower(), factor * section.upper()));
  }
  return scaled;
}

}  // namespace dynacom::internal
