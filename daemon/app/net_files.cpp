#include "daemon/app/net_files.hpp"

#include <filesystem>

#include "daemon/app/config.hpp"
#include "daemon/app/service.hpp"
#include "daemon/serve/admission.hpp"
#include "daemon/serve/security.hpp"
#include "daemon/serve/tls.hpp"

namespace dtact::app {

void resolve_credentials(net::NetConfig& config) {
  config.tls_certificate = resolve_credential("net.tls_certificate", config.tls_certificate);
  config.tls_key = resolve_credential("net.tls_key", config.tls_key);
  config.token_file = resolve_credential("net.tokens", config.token_file);
}

void check_net_files(net::NetConfig config) {
  net::check_security(config);
  const auto out_of_reach = [known = has_credentials()](const std::filesystem::path& file) {
    return !known && file.string().starts_with(kCredential);
  };
  if (out_of_reach(config.tls_certificate) || out_of_reach(config.tls_key)) {
    config.tls_certificate.clear();
    config.tls_key.clear();
  }
  if (out_of_reach(config.token_file)) config.token_file.clear();
  resolve_credentials(config);
  (void)net::make_tls(config);
  (void)net::read_tokens(config);
}

}  // namespace dtact::app
