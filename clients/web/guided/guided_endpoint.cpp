#include "clients/web/guided/guided_endpoint.hpp"

#include <fmt/chrono.h>
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <google/protobuf/util/json_util.h>

#include <algorithm>
#include <chrono>
#include <optional>
#include <stdexcept>
#include <system_error>
#include <utility>

#include "clients/common/guided.pb.h"
#include "clients/common/json.hpp"
#include "clients/common/sibling_program.hpp"

namespace dtact::web::guided {

namespace fs = std::filesystem;

namespace {

constexpr std::string_view kBefore = "/sensors/";
constexpr std::string_view kBehind = "/calibrate";
constexpr const char* kProgram = "dtact-calibrate";

cli::GuidedStart parse_start(const std::string& text) {
  google::protobuf::util::JsonParseOptions lenient;
  lenient.ignore_unknown_fields = true;
  cli::GuidedStart start;
  if (!google::protobuf::util::JsonStringToMessage(text, &start, lenient).ok()) {
    throw std::runtime_error("the first message has to be a GuidedStart in JSON");
  }
  return start;
}

/// The youngest folder of the sensor's sessions.
std::optional<fs::path> last_folder(const fs::path& work, const std::string& name) {
  std::optional<fs::path> last;
  std::error_code none;
  for (const auto& entry : fs::directory_iterator(work, none)) {
    const std::string found = entry.path().filename().string();
    if (found.size() != name.size() + 16 || !found.starts_with(name + "-")) continue;
    if (!last || last->filename() < entry.path().filename()) last = entry.path();
  }
  return last;
}

fs::path folder_for(const fs::path& work, const std::string& name, bool resume) {
  if (resume) {
    if (const auto last = last_folder(work, name)) return *last;
    throw std::runtime_error("there is no session of this sensor to go on with");
  }
  const auto now =
      std::chrono::time_point_cast<std::chrono::seconds>(std::chrono::system_clock::now());
  return work / fmt::format("{}-{:%Y%m%d-%H%M%S}", name, fmt::gmtime(now));
}

/// dtact-calibrate's command line.
std::vector<std::string> words_for(const client::Options& daemon, const cli::GuidedStart& start,
                                   const fs::path& folder) {
  std::vector<std::string> words = {cli::sibling(kProgram), "--host", daemon.host, "--port",
                                    std::to_string(daemon.port)};
  const auto add = [&](const char* option, std::string value) {
    words.emplace_back(option);
    words.push_back(std::move(value));
  };
  if (daemon.tls && !daemon.tls->fingerprint.empty()) add("--fingerprint", daemon.tls->fingerprint);
  if (daemon.tls && !daemon.tls->ca_file.empty()) add("--ca-file", daemon.tls->ca_file.string());
  if (!daemon.token.empty()) add("--token-file", Child::kSecretFile);
  if (daemon.insecure) words.emplace_back("--insecure");
  words.emplace_back("guided");
  words.emplace_back("--json");
  add("--radius-mm", fmt::to_string(start.radius_mm()));
  add("--mm-per-px", fmt::to_string(start.mm_per_px()));
  if (!start.crop().empty()) add("--crop", fmt::to_string(fmt::join(start.crop(), ",")));
  if (!start.centre().empty()) add("--centre", fmt::to_string(fmt::join(start.centre(), ",")));
  if (start.presses() > 0) add("--presses", std::to_string(start.presses()));
  add("--folder", folder.string());
  return words;
}

}  // namespace

GuidedEndpoint::GuidedEndpoint(std::vector<Calibrated> sensors, fs::path work,
                               const net::NetConfig& config, net::Admission& admission)
    : sensors_(std::move(sensors)),
      work_(std::move(work)),
      config_(config),
      admission_(admission) {}

void GuidedEndpoint::stop() {
  for (const Open& open : std::exchange(relays_, {})) {
    if (const auto relay = open.relay.lock()) relay->close();
  }
}

void GuidedEndpoint::end_revoked() {
  for (const Open& open : relays_) {
    const auto relay = open.relay.lock();
    if (relay == nullptr || admission_.still_allows(open.grant)) continue;
    relay->finish("this token was revoked, or given other rights");
  }
}

/// "/sensors/NAME/calibrate"
const Calibrated* GuidedEndpoint::find(std::string_view path) const {
  if (!path.starts_with(kBefore) || !path.ends_with(kBehind)) return nullptr;
  path.remove_prefix(kBefore.size());
  path.remove_suffix(std::min(path.size(), kBehind.size()));
  const auto found = std::ranges::find_if(
      sensors_, [&](const Calibrated& one) { return one.source->name() == path; });
  return found == sensors_.end() ? nullptr : &*found;
}

Upgrade GuidedEndpoint::upgrade(std::string_view path, std::string token) {
  return {.max_message = Relay::kMaxMessage,
          .open = [this, sensor = find(path), token = std::move(token)](
                      std::shared_ptr<WebSocket> socket, const net::Peer& peer) {
            admit(*sensor, std::move(socket), peer, token);
          }};
}

void GuidedEndpoint::admit(const Calibrated& sensor, std::shared_ptr<WebSocket> socket,
                           const net::Peer& peer, const std::string& token) {
  const auto verdict = admission_.enter(peer, token);
  const std::string token_name = verdict.grant ? verdict.grant->name : "";
  const auto log = [this, peer, token_name, admitted = verdict.grant.has_value(),
                    name = sensor.source->name()](const std::string& what) {
    config_.log({net::LogLevel::info,
                 fmt::format("calibration of {} by {}{}{}: {}", name, peer.address,
                             token_name.empty() ? "" : ", token ", token_name, what),
                 peer.address,
                 admitted ? net::LogSubject::change : net::LogSubject::unauthenticated,
                 token_name});
  };
  Relay::Handlers handlers;
  handlers.begin = [this, &sensor, log, verdict](const std::string& start, Relay& relay,
                                                 Child::Handlers of_child) {
    const auto& daemon = sensor.source->daemon();
    if (verdict.grant->rights < net::Rights::calibrate ||
        (daemon && daemon->rights() < v1::RIGHTS_CALIBRATE)) {
      throw std::runtime_error(
          "this client may not calibrate: connect with a token that allows calibrate");
    }
    auto child = begin(sensor, start, relay, std::move(of_child));
    log("begun");
    return child;
  };
  handlers.ended = [this, peer, log, entered = verdict.grant.has_value()] {
    if (entered) admission_.leave(peer);
    log("over");
  };
  const auto relay = std::make_shared<Relay>(std::move(socket), std::move(handlers));
  std::erase_if(relays_, [](const Open& open) { return open.relay.expired(); });
  relays_.push_back({relay, verdict.grant.value_or(net::Tokens::Grant{})});
  if (!verdict.grant) return relay->refuse(verdict.sentence);
  relay->start();
}

std::shared_ptr<Child> GuidedEndpoint::begin(const Calibrated& sensor, const std::string& start,
                                             Relay& relay, Child::Handlers handlers) {
  const cli::GuidedStart wish = parse_start(start);
  const std::string& name = sensor.source->name();
  if (const auto other = children_[name].lock(); other != nullptr && other->runs()) {
    throw std::runtime_error("somebody calibrates this sensor already");
  }
  const fs::path folder = folder_for(work_, name, wish.resume());
  cli::GuidedLine line;
  line.mutable_started()->set_folder(folder.string());
  relay.send_text(cli::json_line(line));
  auto child = std::make_shared<Child>(relay.executor());
  try {
    child->start(words_for(sensor.options, wish, folder), sensor.options.token,
                 std::move(handlers));
  } catch (const std::system_error& e) {
    throw std::runtime_error(
        fmt::format("cannot start {}, which makes calibrations: {}. It belongs beside dtact-web "
                    "({}) or into PATH: install it from the same release",
                    kProgram, e.code().message(), cli::own_folder()));
  }
  children_[name] = child;
  return child;
}

}  // namespace dtact::web::guided
