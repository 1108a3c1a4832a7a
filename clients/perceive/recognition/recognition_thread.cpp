#include "clients/perceive/recognition/recognition_thread.hpp"

#include <sys/stat.h>

#include <algorithm>
#include <chrono>
#include <filesystem>
#include <memory>
#include <utility>

#include "clients/perceive/recognition/taught_objects.hpp"
#include "proto/dtact.pb.h"

namespace dtact::perceive {
namespace {

using Clock = std::chrono::steady_clock;

v1::Recognition::Verdict to_wire(Verdict verdict) {
  switch (verdict) {
    case Verdict::known:
      return v1::Recognition::KNOWN;
    case Verdict::unknown:
      return v1::Recognition::UNKNOWN;
    case Verdict::unsure:
      return v1::Recognition::UNSURE;
    case Verdict::too_shallow:
      return v1::Recognition::TOO_SHALLOW;
    case Verdict::cut_off:
      return v1::Recognition::CUT_OFF;
  }
  return v1::Recognition::UNSPECIFIED;
}

}  // namespace

RecognitionThread::RecognitionThread(std::filesystem::path taught)
    : folder_(std::move(taught)), thread_([this](const auto& stop) { run(stop); }) {}

void RecognitionThread::offer(const DepthGrid& depth, std::uint64_t sequence) {
  {
    const std::scoped_lock lock(mutex_);
    waiting_ = {depth, {depth.values.begin(), depth.values.end()}, sequence, contact_};
  }
  changed_.notify_all();
}

void RecognitionThread::release() {
  const std::scoped_lock lock(mutex_);
  waiting_.reset();
  ++contact_;
  sequence_ = 0;
  evidence_.release();
}

void RecognitionThread::forget() {
  release();
  const std::scoped_lock lock(mutex_);
  evidence_.forget();
}

void RecognitionThread::wait() {
  std::unique_lock lock(mutex_);
  changed_.wait(lock, [this] { return !waiting_ && !busy_; });
}

void RecognitionThread::read_taught() {
  decltype(files_) files;
  std::shared_ptr<const std::vector<TaughtObject>> taught;
  try {
    for (std::string& name : taught_names(folder_)) {
      struct stat status{};
      (void)::stat(file_of(folder_, name).c_str(), &status);
      const std::int64_t changed =
          std::int64_t{status.st_ctim.tv_sec} * 1'000'000'000 + status.st_ctim.tv_nsec;
      files.emplace_back(std::move(name), changed);
    }
    if (files == files_) return;
    // A damaged file may be half copied: it is read again when it changes.
    taught =
        std::make_shared<const std::vector<TaughtObject>>(load_taught(network_, folder_).objects);
  } catch (const std::exception&) {
    return;  // The folder is unreadable, or went meanwhile: the objects known so far remain.
  }
  files_ = std::move(files);
  const std::scoped_lock lock(mutex_);
  evidence_.set_taught(std::move(taught));
}

void RecognitionThread::run(const std::stop_token& stop) {
  std::unique_lock lock(mutex_);
  while (changed_.wait(lock, stop, [this] { return waiting_.has_value(); })) {
    if (!waiting_) continue;
    Offer offer = std::move(*waiting_);
    waiting_.reset();
    busy_ = true;
    lock.unlock();
    if (!folder_.empty()) read_taught();
    const auto begin = Clock::now();
    offer.depth.values = offer.values;
    const TouchMap map = touch_map(offer.depth);
    const Network::Output output = network_.run(map);
    const auto took = Clock::now() - begin;
    lock.lock();
    busy_ = false;
    if (offer.contact == contact_) {
      evidence_.add(map, output);
      sequence_ = offer.sequence;
      took_ns_ = static_cast<std::uint32_t>(std::chrono::nanoseconds(took).count());
    }
    changed_.notify_all();
    const auto next = begin + std::chrono::duration<double>(1 / kMaxHz);
    changed_.wait_until(lock, stop, next, [] { return false; });
  }
}

bool RecognitionThread::fill(int presses, v1::Recognition& out) const {
  const std::scoped_lock lock(mutex_);
  if (sequence_ == 0) return false;
  const Recognised found = evidence_.result(presses);
  out.set_verdict(to_wire(found.verdict));
  out.set_model(std::string(Network::hash()));
  out.set_presses(static_cast<std::uint32_t>(found.presses));
  out.set_sequence(sequence_);
  out.set_took_ns(took_ns_);
  out.set_score(found.score);
  constexpr std::size_t kCandidates = 5;
  for (std::size_t i = 0; i < std::min(kCandidates, found.candidates.size()); ++i) {
    v1::Recognition::Candidate& candidate = *out.add_candidates();
    candidate.set_name(found.candidates[i].name);
    candidate.set_probability(found.candidates[i].probability);
    candidate.set_taught(found.candidates[i].taught);
  }
  return true;
}

}  // namespace dtact::perceive
