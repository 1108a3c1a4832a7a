#pragma once

#include <boost/asio/io_context.hpp>
#include <boost/asio/thread_pool.hpp>
#include <chrono>
#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <variant>

#include "daemon/net/calibration_store.hpp"
#include "daemon/net/overview.hpp"
#include "daemon/pipeline/port.hpp"
#include "daemon/serve/net_config.hpp"
#include "daemon/serve/session.hpp"

namespace dtact::v1 {
class ActivateCalibration;
class GetCalibration;
class SetLight;
class SetReconstruction;
class Subscribe;
class UploadCalibration;
}  // namespace dtact::v1

namespace dtact::net {

class Hub;

/// What clients may ask for: checks requests, passes them to the pipeline or to the worker (files
/// take longer than a frame) and sends each one answer. All on the network thread.
///
/// The light: the last writer wins. A partial update changes the light that was asked for last,
/// also while the ring has not shown it yet.
class Commands : public std::enable_shared_from_this<Commands> {
 public:
  Commands(boost::asio::io_context& io, boost::asio::thread_pool& worker, const NetConfig& config,
           Hub& hub, pipeline::Port& port, CalibrationStore& store);

  void on_request(const std::shared_ptr<Session>& session, const v1::ClientMessage& message);
  void on_done(const pipeline::CommandDone& done);
  /// The ring shows another light.
  void on_light(const hal::Light& light);
  [[nodiscard]] Overview overview() const;

 private:
  /// An upload, or without one the activation of a number.
  struct CalibrationChange {
    std::shared_ptr<const CalibrationFiles> upload;
    std::uint64_t number = 0;
    std::string name;    ///< Once it was read.
    std::uint64_t key;   ///< The pipeline's, once it uses it.
    pipeline::Stamp at;  ///< When that was.
  };
  /// A request that the pipeline is working on.
  struct Pending {
    std::weak_ptr<Session> session;
    std::uint64_t id = 0;
    struct Rezero {};
    struct Reference {};
    std::variant<Rezero, hal::Light, CalibrationChange, Reference, pipeline::ReconstructionRules>
        what;
  };
  using Who = std::pair<std::shared_ptr<Session>, std::uint64_t>;

  static constexpr const char* kBusy = "too many commands wait: ask again in a moment";

  void subscribe(const Who& who, const v1::Subscribe& request);
  void set_light(const Who& who, const v1::SetLight& request);
  void rezero(const Who& who, bool force);
  void get_status(const Who& who);
  void ping(const Who& who);
  void set_reconstruction(const Who& who, const v1::SetReconstruction& request);
  void tell_reconstruction(const pipeline::ReconstructionRules& rules, const pipeline::Stamp& at);
  /// False, with the answer sent, when the pipeline cannot take another command.
  [[nodiscard]] bool submit(const Who& who, decltype(pipeline::Command::what) command,
                            decltype(Pending::what) what);

  // calibration_commands.cpp
  void get_calibration(const Who& who, const v1::GetCalibration& request);
  void list_calibrations(const Who& who);
  void upload_calibration(const Who& who, const v1::UploadCalibration& request);
  void activate_calibration(const Who& who, const v1::ActivateCalibration& request);
  /// Reads and checks on the worker; then the pipeline uses it, then keep_calibration().
  void change_calibration(const Who& who, CalibrationChange change);
  void keep_calibration(const Pending& pending, const CalibrationChange& change);
  void tell_calibration(const CalibrationChange& change, std::optional<std::uint64_t> number);
  void get_reference(const Who& who);
  void send_reference(const Who& who,
                      const std::shared_ptr<const pipeline::ReferenceCopy>& reference);
  /// Runs `work` on the worker and then `done`(its result) here.
  template <typename Work, typename Done>
  void on_worker(Work work, Done done);

  boost::asio::io_context& io_;
  boost::asio::thread_pool& worker_;
  const NetConfig& config_;
  Hub& hub_;
  pipeline::Port& port_;
  CalibrationStore& store_;
  std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();
  std::map<std::uint64_t, Pending> pending_;  ///< By ticket. The pipeline bounds how many.
  std::uint64_t next_ticket_ = 1;
  std::optional<hal::Light> light_;  ///< Asked for last; empty: what the ring shows.
  int lights_pending_ = 0;
  /// Of the calibration that the pipeline uses, if it uses one; nothing when that has no number or
  /// the store failed to keep it.
  std::optional<std::uint64_t> in_use_;
  bool changing_ = false;  ///< One at a time: an upload may be as large as a message.
  int reading_ = 0;
};

}  // namespace dtact::net
