#include "clients/recording/recorder.hpp"

#include <chrono>
#include <utility>

namespace dtact::recording {
namespace {

using Clock = std::chrono::steady_clock;
constexpr std::chrono::seconds kFlush{1};

}  // namespace

Recorder::Recorder(mcap::Sink& sink, const RecordingOptions& options, std::size_t max_waiting)
    : writer_(sink, options), max_waiting_(max_waiting), thread_([this] { run(); }) {}

Recorder::~Recorder() { end(); }

void Recorder::end() {
  {
    const std::scoped_lock lock(mutex_);
    ending_ = true;
  }
  arrived_.notify_one();
  if (thread_.joinable()) thread_.join();
}

void Recorder::finish() {
  {
    const std::scoped_lock lock(mutex_);
    finishing_ = true;
  }
  end();
  if (failure_) std::rethrow_exception(failure_);
}

void Recorder::add(v1::Frame frame) {
  const std::size_t bytes = frame.ByteSizeLong();
  {
    const std::scoped_lock lock(mutex_);
    if (failure_) return;
    if (waiting_bytes_ + bytes > max_waiting_) {
      ++counts_.dropped;
      return;
    }
    ++counts_.frames;
  }
  put(std::move(frame), bytes);
}

void Recorder::put(Item item, std::size_t bytes) {
  {
    const std::scoped_lock lock(mutex_);
    if (failure_) return;
    waiting_bytes_ += bytes;
    queue_.push_back({std::move(item), bytes});
  }
  arrived_.notify_one();
}

bool Recorder::failed() const {
  const std::scoped_lock lock(mutex_);
  return failure_ != nullptr;
}

Recorder::Counts Recorder::counts() const {
  const std::scoped_lock lock(mutex_);
  return counts_;
}

void Recorder::write(Item item) {
  if (auto* frame = std::get_if<v1::Frame>(&item)) {
    writer_.add(std::move(*frame));
  } else if (const auto* event = std::get_if<v1::Event>(&item)) {
    writer_.add(*event);
  } else if (const auto* status = std::get_if<v1::Status>(&item)) {
    writer_.add(*status);
  } else {
    const auto& attachment = std::get<mcap::Attachment>(item);
    writer_.attach(attachment.name, attachment.media_type, attachment.data);
  }
}

void Recorder::run() {
  try {
    auto flush_due = Clock::now() + kFlush;
    for (;;) {
      Waiting next;
      bool any = false;
      {
        std::unique_lock lock(mutex_);
        arrived_.wait_until(lock, flush_due, [this] { return ending_ || !queue_.empty(); });
        counts_.bytes = writer_.bytes();
        if (queue_.empty() && ending_) break;
        if (!queue_.empty()) {
          next = std::move(queue_.front());
          queue_.pop_front();
          any = true;
        }
      }
      if (any) {
        write(std::move(next.item));
        const std::scoped_lock lock(mutex_);
        waiting_bytes_ -= next.bytes;
      }
      if (const auto now = Clock::now(); now >= flush_due) {
        writer_.flush();
        flush_due = now + kFlush;
      }
    }
    if (finishing_) writer_.finish();
    const std::scoped_lock lock(mutex_);
    counts_.bytes = writer_.bytes();
  } catch (...) {
    const auto failure = std::current_exception();
    try {
      // The index is small: often there is room for it where there is none for a chunk.
      writer_.finish();
    } catch (const std::exception&) {  // NOLINT(bugprone-empty-catch)
      // The file ends after its last whole chunk, which is how a reader takes it.
    }
    const std::scoped_lock lock(mutex_);
    failure_ = failure;
    queue_.clear();
    // Neither what waited nor what the refused chunk held is in the file.
    counts_.frames = writer_.frames();
    counts_.bytes = writer_.bytes();
  }
}

}  // namespace dtact::recording
