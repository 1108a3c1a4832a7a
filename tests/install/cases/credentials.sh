# shellcheck shell=bash disable=SC2154
# Tokens, key and certificate that only root can read on disk reach the unprivileged daemon as systemd's
# credentials.
store=/etc/credstore
fingerprint=$(dtactctl cert -o /tmp/keys | sed -n 's/^--fingerprint //p')
install -m 600 /tmp/keys/dtactd.crt $store/dtactd.tls-certificate
install -m 600 /tmp/keys/dtactd.key $store/dtactd.tls-key
dtactctl token --new view -o /tmp/token > /tmp/token-line
install -m 600 /tmp/token-line $store/dtactd.tokens
sed -i '/^\[net\]/,/^\[metrics\]/{
  s|^tls_certificate = ""|tls_certificate = "credential:tls-certificate"|
  s|^tls_key = ""|tls_key = "credential:tls-key"|
  s|^tokens = ""|tokens = "credential:tokens"|
}' "$config"
systemctl restart dtactd
tls=(--host 127.0.0.1 --fingerprint "$fingerprint")
within 120 dtactctl "${tls[@]}" --token-file /tmp/token status
expect "asks for a token" dtactctl "${tls[@]}" status
frames 30 5 "${tls[@]}" --token-file /tmp/token
expect 'control' dtactctl "${tls[@]}" --token-file /tmp/token led --brightness 10
# The check before a reload may not be able to read them.
before=$(pid)
sed -i 's/^max_clients = 32 /max_clients = 31 /' "$config"
systemctl reload dtactd || fail "a reload with credentials is refused: $(journalctl --no-pager -b -u dtactd | tail -n 5)"
within 60 journal_says 'changed: net.max_clients'
is_still "$before"
runuser -u dtactd -- test -r $store/dtactd.tokens && fail "the daemon's user reads the tokens on disk"
# A token that is revoked there may count until a restart (systemd 252 passes new ones with a reload,
# later ones do not), and the reload reports that.
dtactctl token --new view -o /tmp/new-token > /tmp/token-line
install -m 600 /tmp/token-line $store/dtactd.tokens
systemctl reload dtactd
within 60 bash -c 'systemctl show -p StatusText dtactd | grep "new credentials need a restart: .*net.tokens"'
systemctl restart dtactd
dtactctl "${tls[@]}" --token-file /tmp/token status && fail "the revoked token is taken"
within 120 dtactctl "${tls[@]}" --token-file /tmp/new-token status
rm -r $store/dtactd.* /tmp/keys /tmp/token /tmp/new-token /tmp/token-line
