// SPDX-License-Identifier: BSD-2-Clause
#include "dynacom/terrain.hpp"

#include <algorithm>
#include <cmath>

#include "check.hpp"
#include "nan.hpp"

namespace dynacom {

namespace {

double findMedian(std::vector<double> values) {
  if (values.empty()) return internal::kNaN;
  const auto middle = values.begin() + std::ptrdiff_t(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  if (values.size() % 2 == 1) return *middle;
  return 0.5 * (*std::max_element(values.begin(), middle) + *middle);
}

double findGroundHeight(const ContactSchedule& schedule, const Eigen::MatrixXd& ground,
                        Eigen::Index contact) {
  std::vector<double> heights;
  for (Eigen::Index frame = 0; frame < ground.cols(); ++frame)
    if (schedule.active(contact, frame) && std::isfinite(ground(contact, frame)))
      heights.push_back(ground(contact, frame));
  return findMedian(std::move(heights));
}

// Whether a row is true at some time in a stance.
bool isActive(const ContactSchedule& schedule, std::size_t row, const Stance& stance) {
  return schedule.active.row(Eigen::Index(row))
      .segment(stance.first, stance.behind - stance.first)
      .any();
}

bool isAlwaysActive(const ContactSchedule& schedule, std::size_t row, const Stance& stance) {
  return schedule.active.row(Eigen::Index(row))
      .segment(stance.first, stance.behind - stance.first)
      .all();
}

// Adds a value, unless there is one that differs by no more than so much.
void addOther(std::vector<double>& values, double value, double same) {
  const auto isSame = [&](double other) { return !(std::abs(value - other) > same); };
  if (std::none_of(values.begin(), values.end(), isSame)) values.push_back(value);
}

std::string removePrefix(const std::string& name, const std::string& prefix) {
  return name.compare(0, prefix.size(), prefix) == 0 ? name.substr(prefix.size()) : name;
}

// Adds a stance that nothing carries, whose height is still that in the world.
void addHeld(std::vector<HeldContact>& held, const std::string& contact, bool is_tilted,
             const std::string& part, const Stance& stance, double begin) {
  auto place = std::find_if(held.begin(), held.end(), [&](const HeldContact& other) {
    return other.name == contact && other.parts.empty() != is_tilted;
  });
  if (place == held.end())
    place = held.insert(place, {contact, {}, stance.first, stance.behind, begin, stance.height});
  if (is_tilted && std::find(place->parts.begin(), place->parts.end(), part) == place->parts.end())
    place->parts.insert(std::upper_bound(place->parts.begin(), place->parts.end(), part), part);
  if (stance.height < place->height) {
    place->first = stance.first;
    place->behind = stance.behind;
    place->begin = begin;
    place->height = stance.height;
  }
}

void requireFitting(const std::vector<PartRobot::Part>& parts, const ContactInference& inference,
                    const ContactSchedule& schedule, const Eigen::MatrixXd& ground,
                    Eigen::Index frames) {
  using internal::requireSize;
  const auto contacts = static_cast<Eigen::Index>(schedule.names.size());
  const auto count = static_cast<Eigen::Index>(parts.size());
  requireSize("inference", inference.schedule.active.rows(), count, "parts");
  requireSize("inference", inference.schedule.active.cols(), frames, "frames");
  requireSize("schedule", schedule.active.rows(), contacts, "contacts");
  requireSize("schedule", schedule.active.cols(), frames, "frames");
  requireSize("ground", ground.rows(), contacts, "heights (one per contact)");
  requireSize("ground", ground.cols(), frames, "frames");
  for (const Stance& stance : inference.stances)
    if (stance.part >= parts.size() || stance.first < 0 || stance.behind <= stance.first ||
        stance.behind > frames)
      internal::throwInvalid("inference.stances must be of ", count, " parts and within ", frames,
                             " frames, got part ", stance.part, " and frames ", stance.first,
                             " to ", stance.behind);
}

}  // namespace

Terrain findTerrain(const std::vector<PartRobot::Part>& parts, const ContactInference& inference,
                    const ContactSchedule& schedule, const Eigen::MatrixXd& ground,
                    const Eigen::VectorXd& time, double ground_height) {
  requireFitting(parts, inference, schedule, ground, time.size());
  const std::size_t count = schedule.names.size();
  Terrain terrain = {};
  terrain.lowest = internal::kNaN;
  for (std::size_t k = 0; k < count; ++k)
    terrain.contacts.push_back(
        {schedule.names[k], findGroundHeight(schedule, ground, Eigen::Index(k)), {}, {}});

  std::vector<double> stood_on;
  for (const Stance& stance : inference.stances) {
    const PartRobot::Part& part = parts[stance.part];
    if (part.contact >= count) continue;
    if (stance.on_ground) {
      if (!isActive(inference.schedule, stance.part, stance)) continue;
      stood_on.push_back(stance.height);
      ContactTerrain& contact = terrain.contacts[part.contact];
      addOther(contact.levels, stance.height, kSameLevel);
      if (!stance.slope.isZero(0.))
        addOther(contact.slopes, std::atan(stance.slope.norm()), kSameSlope);
      continue;
    }
    if (time[stance.behind - 1] - time[stance.first] < kHeldDuration) continue;
    const std::string& name = schedule.names[part.contact];
    addHeld(terrain.held, name, isAlwaysActive(schedule, part.contact, stance),
            removePrefix(part.name, name + "."), stance, time[stance.first]);
  }

  for (ContactTerrain& contact : terrain.contacts)
    for (std::vector<double>* values : {&contact.levels, &contact.slopes})
      std::sort(values->begin(), values->end());
  for (const double height : stood_on) terrain.lowest = std::fmin(terrain.lowest, height);
  if (stood_on.empty())
    for (const ContactTerrain& contact : terrain.contacts)
      terrain.lowest = std::fmin(terrain.lowest, contact.height);
  if (!std::isnan(ground_height))
    terrain.level = ground_height;
  else if (!stood_on.empty())
    terrain.level = findMedian(std::move(stood_on));
  for (HeldContact& held : terrain.held) held.height -= terrain.level;
  return terrain;
}

}  // namespace dynacom
