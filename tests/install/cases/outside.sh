# shellcheck shell=bash disable=SC2154
# A client on another machine (a network namespace behind a veth pair): refused by the unit until the
# administrator names its address, then served the camera's 60 frames a second.
ip netns add other
ip link add veth0 type veth peer name veth1 netns other
ip address add 192.168.7.1/24 dev veth0
ip link set veth0 up
ip -n other address add 192.168.7.2/24 dev veth1
ip -n other link set veth1 up
cp "$config" /tmp/good.toml
sed -i '/^\[net\]/,/^\[metrics\]/s/^address = "127.0.0.1"/address = "192.168.7.1"/; s/^listen_insecure = false/listen_insecure = true/' "$config"
systemctl restart dtactd
within 120 systemctl is-active dtactd
within 60 bash -c 'ss -ltn | grep -q 192.168.7.1:7377'
timeout 10 ip netns exec other dtactctl --host 192.168.7.1 status > /tmp/refused 2>&1 && fail "let in without IPAddressAllow="
sed 's/^/client: /' /tmp/refused
printf '[Service]\nIPAddressAllow=192.168.7.0/24\n' > /etc/systemd/system/dtactd.service.d/network.conf
systemctl daemon-reload
systemctl restart dtactd
within 120 ip netns exec other dtactctl --host 192.168.7.1 status
reported=$(ip netns exec other python3 /job/stream.py 192.168.7.1 60 600 2>&1) || fail "$reported"
say "$reported"
rm /etc/systemd/system/dtactd.service.d/network.conf
cp /tmp/good.toml "$config"
systemctl daemon-reload
ip netns delete other
systemctl restart dtactd
within 120 serving
