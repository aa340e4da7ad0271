// SPDX-License-Identifier: BSD-2-Clause
#include "dynacom/contact_inference.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>

#include "../check.hpp"
#include "../nan.hpp"
#include "../standard_gravity.hpp"
#include "cone_projection.hpp"
#include "contact_inference.hpp"
#include "dynacom/contact_point.hpp"
#include "ground_slope.hpp"
#include "schedule_path.hpp"

namespace dynacom {

using Eigen::Index;
using internal::kNaN;

namespace {

// How readily parts bear load: less where their contact has just begun, or is about to end.
Eigen::MatrixXd findReadiness(const ContactSchedule::Matrix& active, const Eigen::VectorXd& time,
                              const DetectionSettings& settings) {
  Eigen::MatrixXd readiness = Eigen::MatrixXd::Ones(active.rows(), active.cols());
  const auto ramp = [&](double since) {
    const double least = settings.ramp_least;
    return least + (1. - least) * std::clamp(since / settings.ramp, 0., 1.);
  };
  for (Index part = 0; part < active.rows(); ++part) {
    double begin = -std::numeric_limits<double>::infinity(), end = -begin;
    for (Index frame = 0; frame < time.size(); ++frame) {
      if (!active(part, frame)) begin = time[frame];
      readiness(part, frame) = std::min(readiness(part, frame), ramp(time[frame] - begin));
    }
    for (Index frame = time.size(); frame-- > 0;) {
      if (!active(part, frame)) end = time[frame];
      readiness(part, frame) = std::min(readiness(part, frame), ramp(end - time[frame]));
    }
  }
  return readiness;
}

// Under a point: of the rest that it is in, or on which it is active; on its way from one to the
// next of the lower one, because nobody knows where a step begins.
double findGround(const internal::Rests& rests, Index frame, bool active) {
  const int owner = rests.owner[static_cast<std::size_t>(frame)];
  if (owner < 0) return kNaN;
  const auto at = static_cast<std::size_t>(owner);
  const internal::Rest& rest = rests.list[at];
  const auto heightOf = [](const internal::Rest& other) {
    return other.on_ground ? other.height : kNaN;
  };
  if (active) return rest.height;
  double height = heightOf(rest);
  if (frame < rest.first && at > 0) height = std::fmin(height, heightOf(rests.list[at - 1]));
  if (frame >= rest.behind && at + 1 < rests.list.size())
    height = std::fmin(height, heightOf(rests.list[at + 1]));
  return height;
}

internal::KnownContacts findKnown(const internal::ContactSplit& parts,
                                  const ContactSchedule& recorded, Index frames) {
  recorded.validate(frames);
  internal::KnownContacts known;
  const std::vector<std::string> names = parts.nameContacts();
  known.masks.resize(names.size(), 0);
  for (std::size_t k = 0; k < parts.parts.size(); ++k)
    if (parts.parts[k].contact < names.size())  // nobody records what links do
      known.masks[parts.parts[k].contact] |= 1u << k;
  known.active.setConstant(Index(names.size()), frames, false);
  for (std::size_t row = 0; row < recorded.names.size(); ++row) {
    const auto own = std::find(names.begin(), names.end(), recorded.names[row]);
    if (own != names.end()) known.active.row(own - names.begin()) = recorded.active.row(Index(row));
  }
  return known;
}

// Writes how steep the ground is under contacts. These stand where parts are at rest that are
// active at some time, those of one contact together.
void writeSlopes(const std::vector<PartRobot::Part>& parts,
                 const std::vector<internal::PointTrack>& tracks, ContactInference& found) {
  std::vector<Stance*> used;
  for (Stance& stance : found.stances)
    if (!tracks[stance.part].is_body && stance.on_ground &&
        found.schedule.active.row(Index(stance.part))
            .segment(stance.first, stance.behind - stance.first)
            .any())
      used.push_back(&stance);
  std::stable_sort(used.begin(), used.end(), [](const Stance* one, const Stance* other) {
    return one->first < other->first;
  });
  std::vector<internal::Footing> footings;
  std::vector<Index> behind;                // the frame at which each ends
  std::vector<std::size_t> whose;           // of each stance, the footing that it belongs to
  std::map<std::size_t, std::size_t> last;  // of each contact, its latest footing
  for (const Stance* stance : used) {
    const std::size_t contact = parts[stance->part].contact;
    const auto own = last.find(contact);
    if (own == last.end() || stance->first >= behind[own->second]) {
      last[contact] = footings.size();
      footings.push_back({contact, {}});
      behind.push_back(stance->behind);
    }
    whose.push_back(last[contact]);
    behind[whose.back()] = std::max(behind[whose.back()], stance->behind);
    Eigen::Matrix3Xd& points = footings[whose.back()].points;
    points.conservativeResize(3, points.cols() + 1);
    points.rightCols<1>() = tracks[stance->part]
                                .position.middleCols(stance->first, stance->behind - stance->first)
                                .rowwise()
                                .mean();
    points(2, points.cols() - 1) = stance->height;
  }
  const std::vector<Eigen::Vector2d> slopes = internal::findGroundSlopes(footings);
  for (std::size_t k = 0; k < used.size(); ++k) used[k]->slope = slopes[whose[k]];
  if (!slopes.empty() && std::all_of(slopes.begin(), slopes.end(),
                                     [&](const auto& slope) { return slope == slopes[0]; }))
    found.slope = slopes[0];
}

}  // namespace

ContactInference inferContacts(const PartRobot& parts, const std::vector<ContactMotion>& motions,
                               const MotionAnalysis& dynamics, bool exact,
                               const DetectionSettings& settings, const ContactSchedule* recorded) {
  return internal::inferContacts(internal::describeSplit(parts), motions, dynamics, exact, settings,
                                 recorded);
}

ContactInference internal::inferContacts(const ContactSplit& parts,
                                         const std::vector<ContactMotion>& motions,
                                         const MotionAnalysis& dynamics, bool exact,
                                         const DetectionSettings& settings,
                                         const ContactSchedule* recorded) {
  settings.validate();
  const Eigen::VectorXd& time = dynamics.time;
  const Index frames = time.size();
  const std::size_t count = parts.parts.size();
  internal::requireSize("motions", motions.size(), count, "parts");
  internal::requireSize("parts.robot", parts.carrier.contacts.size(), count, "contacts");
  constexpr std::size_t most = ConeProjection::kMaximalPoints;
  if (count > most)
    internal::throwInvalid("contacts must have at most ", most, " parts, got ", count);
  for (const auto* values : {&dynamics.com, &dynamics.ground_force, &dynamics.ground_torque})
    internal::requireSize("dynamics", values->cols(), frames, "frames");

  const std::size_t contacts = parts.countContacts();
  std::vector<internal::PointTrack> tracks;
  tracks.reserve(count);
  const auto addTrack = [&](std::size_t k, const Eigen::Matrix3Xd& velocity) {
    const auto* contact =
        dynamic_cast<const ContactPoint*>(parts.carrier.contacts[k].contact.get());
    const Section friction =
        contact ? contact->getSettings().makeFriction(contact->getSettings().mu) : Section();
    tracks.push_back({parts.parts[k].limb, friction, parts.parts[k].contact >= contacts,
                      motions[k].position, velocity});
  };
  for (std::size_t k = 0; k < count; ++k) {
    for (const auto* values : {&motions[k].position, &motions[k].velocity})
      internal::requireSize("motions", values->cols(), frames, "frames (as many as dynamics)");
    addTrack(k, motions[k].velocity);
  }

  // As the ground sees them, where that moves.
  const Eigen::Vector3d ground_velocity = settings.ground_velocity.array().isNaN().any()
                                              ? internal::findGroundVelocity(tracks)
                                              : settings.ground_velocity;
  std::vector<Eigen::Matrix3Xd> velocities;
  if (!ground_velocity.isZero(0.)) {
    for (const internal::PointTrack& track : tracks)
      velocities.push_back(track.velocity.colwise() - ground_velocity);
    tracks.clear();
    for (std::size_t k = 0; k < count; ++k) addTrack(k, velocities[k]);
  }

  internal::KnownContacts known;
  if (recorded) known = findKnown(parts, *recorded, frames);
  const std::vector<internal::Rests> rests =
      internal::findRests(tracks, time, exact, settings, recorded ? &known : nullptr);
  const internal::CostScales scales = internal::findScales(tracks, rests, time, settings);
  const internal::WrenchTrack wrench{dynamics.com, dynamics.ground_force, dynamics.ground_torque};
  const double weight = parts.carrier.mass * internal::findUnitGravity(parts.carrier.gravity);
  const internal::SchedulePath path = internal::findSchedulePath(
      tracks, rests, scales, wrench, weight, time, settings, recorded ? &known : nullptr);

  ContactInference found;
  found.ground_velocity = ground_velocity;
  found.schedule.active.resize(Index(count), frames);
  found.schedule.confidence = path.probability;
  found.missing = path.missing;
  found.ground.setConstant(Index(count), frames, kNaN);
  for (std::size_t k = 0; k < count; ++k) {
    found.schedule.names.push_back(parts.parts[k].name);
    for (Index frame = 0; frame < frames; ++frame) {
      found.schedule.active(Index(k), frame) = path.sets[static_cast<std::size_t>(frame)] >> k & 1u;
      const bool active = found.schedule.active(Index(k), frame);
      if (!active && tracks[k].is_body) continue;
      found.ground(Index(k), frame) = std::isnan(settings.ground_height)
                                          ? findGround(rests[k], frame, active)
                                          : settings.ground_height;
    }
    const std::vector<int>& owner = rests[k].owner;
    Index begin = 0;
    for (std::size_t i = 0; i < rests[k].list.size(); ++i) {
      const internal::Rest& rest = rests[k].list[i];
      const Index end = std::upper_bound(owner.begin(), owner.end(), int(i)) - owner.begin();
      found.stances.push_back(
          {k, rest.first, rest.behind, rest.height, rest.on_ground, begin, end});
      begin = end;
    }
  }
  writeSlopes(parts.parts, tracks, found);
  found.schedule.readiness = findReadiness(found.schedule.active, time, settings);
  return found;
}

}  // namespace dynacom
