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
/// Programs that may run at the same time without a sensor, such as those that list taught objects.
constexpr std::size_t kMaxWithoutSensor = 4;

cli::GuidedStart parse_start(const std::string& text) {
  google::protobuf::util::JsonParseOptions lenient;
  lenient.ignore_unknown_fields = true;
  cli::GuidedStart start;
  if (!google::protobuf::util::JsonStringToMessage(text, &start, lenient).ok()) {
    throw std::runtime_error("the first message has to be a GuidedStart in JSON");
  }
  return start;
}

/// The youngest folder of the sensor's sessions that have got as far as the reference.
std::optional<fs::path> last_folder(const fs::path& work, const std::string& name) {
  std::optional<fs::path> last;
  std::error_code none;
  for (const auto& entry : fs::directory_iterator(work, none)) {
    const std::string found = entry.path().filename().string();
    if (found.size() != name.size() + 16 || !found.starts_with(name + "-")) continue;
    if (!fs::exists(entry.path() / "reference" / "sensor.toml", none)) continue;
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

using Words = std::vector<std::string>;

void add(Words& words, const char* option, std::string value) {
  words.emplace_back(option);
  words.push_back(std::move(value));
}

/// dtact-calibrate with the options that reach the daemon.
Words words_for(const client::Options& daemon) {
  Words words = {cli::sibling(kProgram), "--host", daemon.host, "--port",
                 std::to_string(daemon.port)};
  if (daemon.tls && !daemon.tls->fingerprint.empty()) {
    add(words, "--fingerprint", daemon.tls->fingerprint);
  }
  if (daemon.tls && !daemon.tls->ca_file.empty()) {
    add(words, "--ca-file", daemon.tls->ca_file.string());
  }
  if (!daemon.token.empty()) add(words, "--token-file", Child::kSecretFile);
  if (daemon.insecure) words.emplace_back("--insecure");
  return words;
}

void add_guided(Words& words, const cli::GuidedStart& start, const fs::path& folder) {
  words.emplace_back("guided");
  words.emplace_back("--json");
  add(words, "--radius-mm", fmt::to_string(start.radius_mm()));
  if (start.ruler().empty()) {
    add(words, "--mm-per-px", fmt::to_string(start.mm_per_px()));
  } else {
    add(words, "--ruler", fmt::to_string(fmt::join(start.ruler(), ",")));
  }
  if (!start.crop().empty()) add(words, "--crop", fmt::to_string(fmt::join(start.crop(), ",")));
  if (!start.centre().empty()) {
    add(words, "--centre", fmt::to_string(fmt::join(start.centre(), ",")));
  }
  if (start.presses() > 0) add(words, "--presses", std::to_string(start.presses()));
  add(words, "--folder", folder.string());
}

void add_objects(Words& words, const cli::ObjectsStart& start, const fs::path& taught) {
  words.emplace_back("objects");
  // What follows "--" is a name, whatever it begins with.
  const auto command = [&](Words of_command, const Words& names) {
    words.insert(words.end(), of_command.begin(), of_command.end());
    add(words, "--taught", taught.string());
    words.emplace_back("--");
    words.insert(words.end(), names.begin(), names.end());
  };
  switch (start.command_case()) {
    case cli::ObjectsStart::kTeach:
      return command({"teach", "--json"}, {start.teach()});
    case cli::ObjectsStart::kForget:
      return command({"forget"}, {start.forget()});
    case cli::ObjectsStart::kRename:
      return command({"rename"}, {start.rename().name(), start.rename().new_name()});
    case cli::ObjectsStart::COMMAND_NOT_SET:
      return command({"list", "--json"}, {});
  }
}

/// What the log calls it; empty: a list is not logged.
std::string subject_of(const cli::GuidedStart& start) {
  if (!start.has_objects()) return "calibration";
  const bool list = start.objects().command_case() == cli::ObjectsStart::COMMAND_NOT_SET;
  return list ? "" : "taught objects";
}

/// Whether it uses the sensor, which one session at a time does.
bool uses_sensor(const cli::GuidedStart& start) {
  return !start.has_objects() || start.objects().has_teach();
}

}  // namespace

GuidedEndpoint::GuidedEndpoint(std::vector<std::shared_ptr<Source>> sensors, fs::path work,
                               fs::path taught, const net::NetConfig& config,
                               net::Admission& admission)
    : sensors_(std::move(sensors)),
      work_(std::move(work)),
      taught_(std::move(taught)),
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
Source* GuidedEndpoint::find(std::string_view path) const {
  if (!path.starts_with(kBefore) || !path.ends_with(kBehind)) return nullptr;
  path.remove_prefix(kBefore.size());
  path.remove_suffix(std::min(path.size(), kBehind.size()));
  const auto found =
      std::ranges::find_if(sensors_, [&](const auto& one) { return one->name() == path; });
  return found == sensors_.end() ? nullptr : found->get();
}

Upgrade GuidedEndpoint::upgrade(std::string_view path, std::string token) {
  return {.max_message = Relay::kMaxMessage,
          .open = [this, sensor = find(path), token = std::move(token)](
                      std::shared_ptr<WebSocket> socket, const net::Peer& peer,
                      const std::shared_ptr<void>&) {
            admit(*sensor, std::move(socket), peer, token);
          }};
}

void GuidedEndpoint::admit(const Source& sensor, std::shared_ptr<WebSocket> socket,
                           const net::Peer& peer, const std::string& token) {
  const auto verdict = admission_.enter(peer, token);
  const std::string token_name = verdict.grant ? verdict.grant->name : "";
  const auto subject = std::make_shared<std::string>("calibration");
  const auto log = [this, peer, token_name, subject, admitted = verdict.grant.has_value(),
                    name = sensor.name()](const std::string& what) {
    if (subject->empty()) return;
    config_.log({net::LogLevel::info,
                 fmt::format("{} of {} by {}{}{}: {}", *subject, name, peer.address,
                             token_name.empty() ? "" : ", token ", token_name, what),
                 peer.address,
                 admitted ? net::LogSubject::change : net::LogSubject::unauthenticated,
                 token_name});
  };
  Relay::Handlers handlers;
  handlers.begin = [this, &sensor, subject, log, verdict](const std::string& start, Relay& relay,
                                                          Child::Handlers of_child) {
    const auto& daemon = sensor.daemon();
    if (verdict.grant->rights < net::Rights::calibrate ||
        (daemon && daemon->rights() < v1::RIGHTS_CALIBRATE)) {
      throw std::runtime_error(
          "this client may not calibrate: connect with a token that allows calibrate");
    }
    const cli::GuidedStart wanted = parse_start(start);
    *subject = subject_of(wanted);
    auto child = begin(sensor, wanted, relay, std::move(of_child));
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

std::shared_ptr<Child> GuidedEndpoint::begin(const Source& sensor, const cli::GuidedStart& start,
                                             Relay& relay, Child::Handlers handlers) {
  const std::string& name = sensor.name();
  const auto other = children_[name].lock();
  if (uses_sensor(start) && other != nullptr && other->runs()) {
    throw std::runtime_error("somebody calibrates this sensor already, or teaches an object");
  }
  std::erase_if(without_sensor_, [](const std::weak_ptr<Child>& weak) {
    const auto one = weak.lock();
    return one == nullptr || !one->runs();
  });
  if (!uses_sensor(start) && without_sensor_.size() >= kMaxWithoutSensor) {
    throw std::runtime_error("too many ask for taught objects: ask again in a moment");
  }
  Words words = words_for(sensor.options());
  if (start.has_objects()) {
    add_objects(words, start.objects(), taught_);
  } else {
    const fs::path folder = folder_for(work_, name, start.resume());
    add_guided(words, start, folder);
    cli::GuidedLine line;
    line.mutable_started()->set_folder(folder.string());
    relay.send_text(cli::json_line(line));
  }
  auto child = std::make_shared<Child>(relay.executor());
  try {
    child->start(std::move(words), sensor.options().token, std::move(handlers));
  } catch (const std::system_error& e) {
    throw std::runtime_error(
        fmt::format("cannot start {}, which calibrates and teaches: {}. It belongs beside "
                    "dtact-web ({}) or into PATH: install it from the same release",
                    kProgram, e.code().message(), cli::own_folder()));
  }
  if (uses_sensor(start)) {
    children_[name] = child;
  } else {
    without_sensor_.push_back(child);
  }
  return child;
}

}  // namespace dtact::web::guided
