#include "daemon/net/calibration_commands.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <boost/asio/executor_work_guard.hpp>
#include <boost/asio/post.hpp>
#include <exception>
#include <utility>

#include "daemon/net/hub.hpp"
#include "daemon/net/messages.hpp"
#include "daemon/net/reconstruction_names.hpp"
#include "hal/base/free_memory.hpp"
#include "hal/base/utf8.hpp"
#include "hal/files/png.hpp"
#include "proto/dtact.pb.h"

namespace dtact::net {
namespace {

namespace asio = boost::asio;

/// Requests to read or pin calibrations, or to read references, that may wait at the same time:
/// half of what the pipeline takes, so that commands have room beside them.
constexpr int kMaxReading = 8;

constexpr const char* kChanging =
    "another calibration or way to make depth is coming into use: ask again in a moment";

bool valid_name(const std::string& name) {
  return !name.empty() && name.size() <= wire::kMaxCalibrationName &&
         std::all_of(name.begin(), name.end(), [](char c) {
           return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') ||
                  c == '-' || c == '_';
         });
}

/// What a step on the worker came to: a value, or an error and the sentence that says why not.
template <typename Value>
struct Outcome {
  Value value{};
  v1::ErrorCode code = v1::ERROR_NONE;
  std::string error;
  [[nodiscard]] bool failed() const noexcept { return code != v1::ERROR_NONE; }
};

/// `failure`: the code when `step` throws something else than std::invalid_argument.
template <typename Value, typename Step>
Outcome<Value> attempt(v1::ErrorCode failure, const Step& step) {
  try {
    return {step(), v1::ERROR_NONE, {}};
  } catch (const std::invalid_argument& e) {
    return {{}, v1::ERROR_INVALID, e.what()};
  } catch (const std::exception& e) {
    return {{}, failure, e.what()};
  }
}

}  // namespace

CalibrationCommands::CalibrationCommands(asio::io_context& io, asio::thread_pool& worker,
                                         const NetConfig& config, Hub& hub, pipeline::Port& port,
                                         CalibrationStore& store)
    : io_(io),
      worker_(worker),
      config_(config),
      hub_(hub),
      port_(port),
      store_(store),
      in_use_(store.started_number()) {
  if (in_use_) hub_.number_calibration(0, *in_use_);  // the pipeline's key of the first
}

template <typename Work, typename Done>
std::function<void()> CalibrationCommands::job(Work work, Done done) {
  // The guard keeps the network thread's loop alive until the result has come back.
  return [guard = asio::make_work_guard(io_), weak = weak_from_this(), work = std::move(work),
          done = std::move(done)]() mutable {
    asio::post(guard.get_executor(),
               [weak = std::move(weak), done = std::move(done), result = work()]() mutable {
                 const auto self = weak.lock();
                 if (self == nullptr) return;
                 self->working_ = false;
                 done(*self, std::move(result));
                 self->next_job();
               });
  };
}

void CalibrationCommands::next_job() {
  auto& jobs = changes_.empty() ? waiting_ : changes_;
  if (working_ || jobs.empty()) return;
  working_ = true;
  asio::post(worker_, std::move(jobs.front()));
  jobs.pop_front();
}

void CalibrationCommands::get(const Requester& requester, const v1::GetCalibration& request) {
  std::optional<std::uint64_t> number = in_use_;
  if (request.has_number()) {
    number = request.number();
  } else if (port_.status().calibration == nullptr) {
    return requester.refuse(v1::ERROR_UNCALIBRATED,
                            "there is no calibration: make one with dtact-calibrate "
                            "depth and send it with dtactctl calibration upload, or take one "
                            "that dtactctl calibration list shows");
  } else if (changing_) {
    return requester.refuse(v1::ERROR_BUSY, kBusy);
  }
  if (!number) {
    return requester.refuse(v1::ERROR_STORAGE,
                            "the files of the calibration in use are not in the daemon's list: "
                            "they could not be written, or lie elsewhere; upload it again, or "
                            "activate one that dtactctl calibration list shows");
  }
  if (reading_ >= kMaxReading) return requester.refuse(v1::ERROR_BUSY, kBusy);
  ++reading_;
  on_worker(
      [&store = store_, number = *number] {
        return attempt<CalibrationFiles>(v1::ERROR_STORAGE, [&] { return store.read(number); });
      },
      [requester](CalibrationCommands& self, Outcome<CalibrationFiles> read) {
        --self.reading_;
        if (read.failed()) return requester.refuse(read.code, read.error);
        requester.reply([&](v1::Reply& out) {
          auto& files = *out.mutable_calibration();
          files.set_number(read.value.number);
          files.set_name(std::move(read.value.name));
          files.set_calibration_toml(std::move(read.value.toml));
          files.set_reference_png(std::move(read.value.png));
        });
      });
}

void CalibrationCommands::list(const Requester& requester) {
  if (reading_ >= kMaxReading) return requester.refuse(v1::ERROR_BUSY, kBusy);
  ++reading_;
  using List = std::vector<StoredCalibration>;
  on_worker(
      [&store = store_] {
        return attempt<List>(v1::ERROR_STORAGE, [&store] { return store.list(); });
      },
      [requester](CalibrationCommands& self, const Outcome<List>& list) {
        --self.reading_;
        if (list.failed()) return requester.refuse(list.code, list.error);
        const bool calibrated = self.port_.status().calibration != nullptr;
        requester.reply([&](v1::Reply& out) {
          auto& calibrations = *out.mutable_calibrations();  // also when there is none
          for (const auto& stored : list.value) {
            auto& one = *calibrations.add_calibrations();
            fill(stored, one);
            one.set_in_use(calibrated && stored.number == self.in_use_);
          }
        });
      });
}

void CalibrationCommands::upload(const Requester& requester, const v1::UploadCalibration& request) {
  if (!valid_name(request.name())) {
    return requester.refuse(
        v1::ERROR_INVALID,
        fmt::format("upload_calibration.name: \"{}\"; allowed are 1 to {} letters, digits, '-' "
                    "and '_'",
                    base::first_bytes(request.name(), wire::kMaxCalibrationName),
                    wire::kMaxCalibrationName));
  }
  if (request.calibration_toml().empty() || request.reference_png().empty()) {
    return requester.refuse(v1::ERROR_INVALID,
                            "upload_calibration: calibration_toml or reference_png is empty: "
                            "send both files of the calibration folder");
  }
  if (changing_) return requester.refuse(v1::ERROR_BUSY, kChanging);
  auto files = std::make_shared<const CalibrationFiles>(CalibrationFiles{
      .name = request.name(), .toml = request.calibration_toml(), .png = request.reference_png()});
  change(requester, {.upload = std::move(files)});
}

void CalibrationCommands::activate(const Requester& requester,
                                   const v1::ActivateCalibration& request) {
  if (!request.has_number()) {
    return requester.refuse(v1::ERROR_INVALID,
                            "activate_calibration.number is not set: dtactctl calibration list "
                            "shows the numbers there are");
  }
  if (changing_) return requester.refuse(v1::ERROR_BUSY, kChanging);
  change(requester, {.number = request.number()});
}

void CalibrationCommands::pin(const Requester& requester, const v1::PinCalibration& request) {
  if (!request.has_number()) {
    return requester.refuse(
        v1::ERROR_INVALID,
        "pin_calibration.number is not set: dtactctl calibration list shows the "
        "numbers there are");
  }
  if (reading_ >= kMaxReading) return requester.refuse(v1::ERROR_BUSY, kBusy);
  ++reading_;
  first_on_worker(
      [&store = store_, number = request.number(), pinned = request.pinned()] {
        return attempt<bool>(v1::ERROR_STORAGE, [&] {
          store.pin(number, pinned);
          return pinned;
        });
      },
      [requester](CalibrationCommands& self, const Outcome<bool>& done) {
        --self.reading_;
        if (done.failed()) return requester.refuse(done.code, done.error);
        requester.reply([](v1::Reply& out) { out.mutable_done(); });
      });
}

void CalibrationCommands::change(const Requester& requester, Change change) {
  changing_ = true;
  using Ready = pipeline::UseCalibration;
  const pipeline::Status now = port_.status();
  const calibration::FrameSize camera{now.camera.width, now.camera.height, now.camera.decode_scale};
  first_on_worker(
      [&store = store_, &port = port_, change, rules = now.reconstruction, camera] {
        auto ready = attempt<Ready>(v1::ERROR_INVALID, [&] {
          return port.prepare(change.upload != nullptr ? store.check(*change.upload, camera)
                                                       : store.load(change.number, camera),
                              rules);
        });
        base::release_free_memory();  // a parsed file is many small pieces
        return ready;
      },
      [requester, change](CalibrationCommands& self, Outcome<Ready> ready) mutable {
        if (ready.failed()) {
          self.changing_ = false;
          return requester.refuse(ready.code, ready.error);
        }
        change.name = ready.value.calibration->name;
        change.key = ready.value.key = ++self.last_key_;
        self.changing_ = submit(self.port_, requester, std::move(ready.value),
                                [&self, requester, change = std::move(change)](
                                    const pipeline::CommandDone& done) mutable {
                                  change.at = done.at;
                                  self.keep(requester, change);
                                });
      });
}

void CalibrationCommands::keep(const Requester& requester, const Change& change) {
  config_.log({LogLevel::info, fmt::format("calibration {} is in use", change.name)});
  in_use_.reset();
  if (change.upload == nullptr) {
    in_use_ = change.number;
    hub_.number_calibration(change.key, change.number);
  }
  // Stored only after the pipeline has accepted it, so that a calibration that does not fit
  // this camera never replaces one that does.
  first_on_worker(
      [&store = store_, change] {
        return attempt<KeptCalibration>(v1::ERROR_STORAGE, [&] {
          if (change.upload != nullptr) return store.keep(*change.upload);
          store.make_current(change.number);
          return KeptCalibration{change.number};
        });
      },
      [requester, change](CalibrationCommands& self, const Outcome<KeptCalibration>& kept) {
        self.changing_ = false;
        if (!kept.failed()) {
          self.in_use_ = kept.value.number;
          self.hub_.number_calibration(change.key, kept.value.number);
        }
        self.report(change, self.in_use_);
        // The client may be gone when the change turns out to be lost after a restart.
        if (kept.failed()) {
          self.config_.log({LogLevel::warning,
                            fmt::format("calibration {} is in use, but the daemon will start with "
                                        "the one before: {}",
                                        change.name, kept.error)});
        }
        if (kept.failed()) {
          // Whatever failed: it was checked and is in use, so the request itself was a valid one.
          return requester.refuse(v1::ERROR_STORAGE,
                                  "the calibration is in use, but the daemon will start with "
                                  "the one before, since the change could not be written: " +
                                      kept.error);
        }
        if (change.upload == nullptr) {
          return requester.reply([](v1::Reply& out) { out.mutable_done(); });
        }
        std::string result = fmt::format("done, calibration {}", kept.value.number);
        for (const StoredCalibration& old : kept.value.removed) {
          result += fmt::format(", removed {} {}", old.number, old.name);
        }
        requester.reply(
            [&](v1::Reply& out) {
              auto& done = *out.mutable_done();
              done.set_calibration(kept.value.number);
              for (const StoredCalibration& old : kept.value.removed) {
                auto& one = *done.add_removed();
                one.set_number(old.number);
                one.set_name(old.name);
                one.set_uploaded(old.uploaded);
              }
            },
            false, result);
      });
}

void CalibrationCommands::report(const Change& change, std::optional<std::uint64_t> number) {
  v1::ServerMessage message;
  auto& event = *message.mutable_event();
  fill(change.at, event);
  event.mutable_calibration()->set_name(change.name);
  if (number) event.mutable_calibration()->set_number(*number);
  hub_.broadcast(message);
}

void CalibrationCommands::set_reconstruction(const Requester& requester,
                                             const v1::SetReconstruction& request) {
  const pipeline::Status now = port_.status();
  pipeline::ReconstructionRules rules = now.reconstruction;
  const std::string wrong = net::change(request, rules);
  if (!wrong.empty()) return requester.refuse(v1::ERROR_INVALID, wrong);
  if (changing_) return requester.refuse(v1::ERROR_BUSY, kChanging);
  changing_ = true;
  using Ready = pipeline::SetReconstruction;
  first_on_worker(
      [&port = port_, in_use = now.calibration, rules] {
        return attempt<Ready>(v1::ERROR_INVALID, [&] { return port.prepare_maps(in_use, rules); });
      },
      [requester, rules](CalibrationCommands& self, Outcome<Ready> ready) {
        if (ready.failed()) {
          self.changing_ = false;
          return requester.refuse(ready.code, ready.error);
        }
        self.changing_ = submit(self.port_, requester, std::move(ready.value),
                                [&self, requester, rules](const pipeline::CommandDone& done) {
                                  self.changing_ = false;
                                  v1::ServerMessage message;
                                  auto& event = *message.mutable_event();
                                  fill(done.at, event);
                                  fill(rules, *event.mutable_reconstruction());
                                  self.hub_.broadcast(message);
                                  requester.reply(done, [&](v1::Reply& out) {
                                    fill(rules, *out.mutable_reconstruction());
                                  });
                                });
      });
}

void CalibrationCommands::get_reference(const Requester& requester) {
  if (reading_ >= kMaxReading) return requester.refuse(v1::ERROR_BUSY, kBusy);
  const auto copied = [this, requester](const pipeline::CommandDone& done) {
    --reading_;
    if (requester.session() == nullptr) return;
    if (done.outcome != pipeline::Outcome::done) return requester.reply(done, [](v1::Reply&) {});
    send_reference(requester, std::get<pipeline::CopyReference>(done.command.what).copy);
  };
  if (submit(port_, requester, pipeline::CopyReference{}, copied)) ++reading_;
}

void CalibrationCommands::send_reference(
    const Requester& requester, const std::shared_ptr<const pipeline::ReferenceCopy>& reference) {
  ++reading_;
  on_worker(
      [reference] {
        return attempt<std::string>(v1::ERROR_STORAGE, [&reference] {
          return image::encode_png(image::Grey16{.width = reference->width,
                                                 .height = reference->height,
                                                 .pixels = reference->image_q8});
        });
      },
      [requester, reference, number = hub_.calibration_number(reference->calibration)](
          CalibrationCommands& self, Outcome<std::string> png) {
        --self.reading_;
        if (png.failed()) return requester.refuse(png.code, png.error);
        requester.reply([&](v1::Reply& out) {
          auto& image = *out.mutable_reference();
          image.set_png(std::move(png.value));
          fill(reference->light, std::nullopt, *image.mutable_light());
          image.set_sequence(reference->sequence);
          if (number) image.set_calibration(*number);
        });
      });
}

}  // namespace dtact::net
