# shellcheck shell=bash disable=SC2154,SC2034
# A configuration with an error: a reload is refused with the reason and disturbs nothing; a restart fails
# with the reason, and the daemon starts once the file is fixed, without another command. The same for a
# reload where the error is in the tokens, which are in a file of their own.
before=$(pid)
cp "$config" /tmp/good.toml
sed -i 's/^fps = .*/fps = "many"/' "$config"
systemctl reload dtactd && fail "a broken configuration was taken"
within 10 journal_says fps
is_still "$before"
frames 60 10
say "restart"
# What the reload said does not count.
sleep 1
since=$(date '+%F %T')
systemctl restart dtactd || true
within 60 journal_says 'Failed with result'
journal_says fps || fail "the restart does not give the reason"
cp /tmp/good.toml "$config"
within 120 serving
say "tokens"
tokens=/etc/dtactd/tokens
dtactctl token --new view -o /tmp/token > $tokens
chown dtactd: $tokens
chmod 600 $tokens
sed -i "/^\[net\]/,/^\[metrics\]/s|^tokens = \"\"|tokens = \"$tokens\"|" "$config"
systemctl restart dtactd
within 120 dtactctl --token-file /tmp/token status
before=$(pid)
echo "view short" > $tokens
systemctl reload dtactd && fail "broken tokens were taken"
within 10 journal_says "$tokens:1: a token itself must not be kept here"
is_still "$before"
dtactctl --token-file /tmp/token status > /dev/null || fail "the tokens in use are gone"
rm $tokens /tmp/token
say "a folder that the service does not see"
cp /tmp/good.toml "$config"
mkdir /home/calibration
sed -i 's|^calibration = ""|calibration = "/home/calibration"|' "$config"
systemctl reload dtactd && fail "a folder in /home was taken"
within 10 journal_says 'calibration = "/home/calibration": '
is_still "$before"
rmdir /home/calibration
