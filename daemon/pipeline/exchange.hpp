#pragma once

#include <atomic>
#include <cstdint>

#include "daemon/pipeline/event_fd.hpp"
#include "daemon/pipeline/latest_slot.hpp"
#include "daemon/pipeline/port.hpp"
#include "daemon/pipeline/spsc_queue.hpp"
#include "daemon/pipeline/statistics.hpp"

namespace dtact::pipeline {

/// All that the capture thread and the network thread share. Each queue has one producer and one
/// consumer; the atomics are single values that need no order among them.
struct Exchange {
  explicit Exchange(const DepthFrame& prototype) : slot(prototype) {}

  LatestSlot<DepthFrame> slot;
  SpscQueue<Command, 16> commands;
  SpscQueue<Event, 64> events;  ///< CommandDone::message is empty: strings allocate.
  EventFd wake;                 ///< Readable when a frame or an event waits.
  Statistics statistics;

  std::atomic<Wanted> wanted{};  ///< Port::want()
  std::atomic<bool> stop{false};
  std::atomic<bool> not_realtime{false};
  /// A camera that was away delivers again: the network thread compares it with the calibration.
  std::atomic<bool> camera_returned{false};
  std::atomic<bool> camera_mismatch{false};
  std::atomic<bool> camera_damaged{false};  ///< What the camera sent last was damaged.
  std::atomic<State> state{State::settling};
  std::atomic<std::uint32_t> health{0};  ///< HealthSet::bits()
  std::atomic<std::uint64_t> frames{0};
  std::atomic<std::uint64_t> sequence{0};  ///< The newest frame's.
  /// Time from a write to the ring to the timestamps of frames exposed under it; -1: unknown.
  std::atomic<std::int64_t> light_lag_ns{-1};
  std::atomic<std::uint64_t> turns{0};    ///< Steps of the capture loop.
  std::atomic<double> camera_fps{0};      ///< By the frames' timestamps; 0 = not known yet.
  std::atomic<double> light_followed{0};  ///< Share of the reference's light, ±.
};

}  // namespace dtact::pipeline
