#pragma once

#include <condition_variable>
#include <cstdint>
#include <filesystem>
#include <mutex>
#include <optional>
#include <stop_token>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "clients/geometry/point_cloud.hpp"
#include "clients/perceive/recognition/recogniser.hpp"

namespace dtact::v1 {
class Recognition;
}

namespace dtact::perceive {

/// Recognises the object in contact on a thread of its own, at most kMaxHz times a second: the
/// newest map replaces one that waits.
class RecognitionThread {
 public:
  /// `taught`: folder of the objects that users have taught, read again when it changes; empty:
  /// none.
  explicit RecognitionThread(std::filesystem::path taught = {});
  RecognitionThread(const RecognitionThread&) = delete;
  RecognitionThread& operator=(const RecognitionThread&) = delete;

  /// A whole depth map of the contact; its values are copied.
  void offer(const DepthGrid& depth, std::uint64_t sequence);
  /// The contact has ended.
  void release();
  /// The same, and earlier contacts no longer count: another sensor or calibration.
  void forget();
  /// What the present contact shows, joined with those before it to `presses` in all. False until
  /// there is an answer.
  [[nodiscard]] bool fill(int presses, v1::Recognition& out) const;
  /// Waits until the offered map is recognised. For runs faster than real time.
  void wait();

  static constexpr double kMaxHz = 10;

 private:
  struct Offer {
    DepthGrid depth;
    std::vector<std::int16_t> values;  ///< Those of `depth`.
    std::uint64_t sequence = 0;
    std::uint64_t contact = 0;
  };
  void run(const std::stop_token& stop);
  void read_taught();

  const std::filesystem::path folder_;
  /// Name and last change of each file that was read, that of its owner and rights included,
  /// nanoseconds since 1970. The thread's alone, as the next one.
  std::vector<std::pair<std::string, std::int64_t>> files_;
  Network network_;
  mutable std::mutex mutex_;  ///< Guards all members below but the thread.
  std::condition_variable_any changed_;
  std::optional<Offer> waiting_;
  bool busy_ = false;
  std::uint64_t contact_ = 0;  ///< Counts contacts: an answer that is too late is dropped.
  Evidence evidence_;
  std::uint64_t sequence_ = 0;  ///< Of the last answer; 0: none in this contact.
  std::uint32_t took_ns_ = 0;
  std::jthread thread_;  ///< Last: it uses the others.
};

}  // namespace dtact::perceive
