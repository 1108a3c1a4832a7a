#pragma once

#include <boost/asio/io_context.hpp>
#include <boost/asio/thread_pool.hpp>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <variant>

#include "daemon/net/calibration_store.hpp"
#include "daemon/pipeline/port.hpp"
#include "daemon/serve/net_config.hpp"
#include "daemon/serve/session.hpp"

namespace dtact::v1 {
class ActivateCalibration;
class GetCalibration;
class UploadCalibration;
}  // namespace dtact::v1

namespace dtact::net {

class Hub;

inline constexpr const char* kBusy = "too many commands wait: ask again in a moment";

/// The requests that read, list and change calibrations, or read the untouched image: their files
/// take longer than a frame, so the worker reads, writes and packs them. All on the network thread.
class CalibrationCommands : public std::enable_shared_from_this<CalibrationCommands> {
 public:
  /// Who asks: the session, and the request's id.
  using Who = std::pair<std::shared_ptr<Session>, std::uint64_t>;
  /// An upload, or without one the activation of a number.
  struct Change {
    std::shared_ptr<const CalibrationFiles> upload;
    std::uint64_t number = 0;
    std::string name;    ///< Once it was read.
    std::uint64_t key;   ///< The pipeline's, once it uses it.
    pipeline::Stamp at;  ///< When that was.
  };
  struct ReferenceWanted {};
  /// Passes a command to the pipeline, to come back by keep(), refused() or copied(). False, with
  /// the answer sent, when the pipeline cannot take another one.
  using Submit = std::function<bool(const Who& who, decltype(pipeline::Command::what) command,
                                    std::variant<Change, ReferenceWanted> what)>;

  CalibrationCommands(boost::asio::io_context& io, boost::asio::thread_pool& worker,
                      const NetConfig& config, Hub& hub, pipeline::Port& port,
                      CalibrationStore& store, Submit submit);

  void get(const Who& who, const v1::GetCalibration& request);
  void list(const Who& who);
  void upload(const Who& who, const v1::UploadCalibration& request);
  void activate(const Who& who, const v1::ActivateCalibration& request);
  void get_reference(const Who& who);

  /// The pipeline uses the calibration: it is kept, told and answered.
  void keep(const std::weak_ptr<Session>& asking, std::uint64_t id, const Change& change);
  /// The pipeline does not take the calibration; the answer is the caller's.
  void refused() noexcept { changing_ = false; }
  /// The pipeline has copied the untouched image, or could not.
  void copied() noexcept { --reading_; }
  void send_reference(const Who& who,
                      const std::shared_ptr<const pipeline::ReferenceCopy>& reference);

 private:
  /// Reads and checks on the worker; then the pipeline uses it, then keep().
  void change(const Who& who, Change change);
  void tell(const Change& change, std::optional<std::uint64_t> number);
  /// Runs `work` on the worker and then `done`(*this, its result) here.
  template <typename Work, typename Done>
  void on_worker(Work work, Done done);

  boost::asio::io_context& io_;
  boost::asio::thread_pool& worker_;
  const NetConfig& config_;
  Hub& hub_;
  pipeline::Port& port_;
  CalibrationStore& store_;
  Submit submit_;
  /// Of the calibration that the pipeline uses, if it uses one; nothing when that has no number or
  /// the store failed to keep it.
  std::optional<std::uint64_t> in_use_;
  bool changing_ = false;  ///< One at a time: an upload may be as large as a message.
  int reading_ = 0;
};

}  // namespace dtact::net
