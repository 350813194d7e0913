# SPDX-License-Identifier: LGPL-2.1-or-later
# Sourced by tests (and by you, to try several hosts on one machine): hosts that are network
# namespaces, joined by a switch. Needs root and iproute2.
#
#   net_need                      skips the test where there is no right to make namespaces
#   net_open                      the switch; all is removed when the shell that called it exits
#   net_host NAME                 a host of that name, with lo, eth0 and an address
#   net_address NAME              prints the address, 10.213.7.2 for the first host, .3, ...
#   net_on NAME COMMAND...        runs a program or script there; with & behind it, $! is that process
#   net_unplug NAME, net_plug NAME  its cable
#   net_faults NAME OPTION...     its cable loses or delays packets from now on, in both directions:
#                                 options of udp-relay (--loss 0.05 --seed 1 ...); again: other ones
#   net_no_faults NAME            a good cable again
#   net_close                     removes all: processes in the hosts, hosts, switch

net_prefix= net_hub= net_shell=
declare -A net_number=() net_relay=()

net_need () {
  [ "$(id -u)" = 0 ] && command -v ip >/dev/null || skip "network namespaces need root and iproute2"
  ip netns add "rc$$-try" 2>/dev/null || skip "no right to make network namespaces"
  ip netns del "rc$$-try"
}

# Those of test runs that were killed.
net_remove_orphans () {
  local name
  for name in $(ip netns list | awk '/^rc[0-9]+-/ { print $1 }'); do
    [ -d "/proc/$(sed -E 's/^rc([0-9]+)-.*/\1/' <<<"$name")" ] || ip netns del "$name" 2>/dev/null || true
  done
}

net_open () {
  net_remove_orphans
  net_shell=$BASHPID net_prefix=rc$BASHPID- net_hub=rc$BASHPID-switch
  trap net_close EXIT
  ip netns add "$net_hub"
  ip -n "$net_hub" link set lo up
  ip -n "$net_hub" link add bridge type bridge mcast_snooping 0
  ip -n "$net_hub" link set bridge up
}

net_host () { # name
  local n=$((${#net_number[@]} + 2)) host=$net_prefix$1
  net_number[$1]=$n
  ip netns add "$host"
  ip -n "$net_hub" link add "v$n" type veth peer name eth0 netns "$host"
  ip -n "$net_hub" link set "v$n" master bridge up
  ip -n "$host" link set lo up
  ip -n "$host" link set eth0 up
  ip -n "$host" addr add "10.213.7.$n/24" dev eth0
  ip -n "$host" route add default via 10.213.7.1 # for multicast, too
}

net_address () { echo "10.213.7.${net_number[$1]:?no host $1}"; }

# In a subshell it becomes the command, which therefore has the number that the caller sees as $!.
net_on () { # name command...
  local host=$net_prefix$1
  : "${net_number[$1]:?no host $1}"
  shift
  [ "$BASHPID" = "$net_shell" ] || exec ip netns exec "$host" "$@"
  ip netns exec "$host" "$@"
}

net_unplug () { ip -n "$net_hub" link set "v${net_number[$1]}" down; }
net_plug () { ip -n "$net_hub" link set "v${net_number[$1]}" up; }

# The cable goes through udp-relay: v<n> - relay - w<n> = x<n> - bridge.
net_faults () { # name udp-relay-options...
  local n=${net_number[$1]:?no host $1} name=$1
  shift
  net_stop_relay "$name"
  if ! ip -n "$net_hub" link show "w$n" >/dev/null 2>&1; then
    ip -n "$net_hub" link add "w$n" type veth peer name "x$n"
    ip -n "$net_hub" link set "x$n" master bridge up
    ip -n "$net_hub" link set "w$n" up
  fi
  ip -n "$net_hub" link set "v$n" nomaster
  ip netns exec "$net_hub" udp-relay --between "v$n,w$n" "$@" >"relay-$name.log" 2>&1 &
  net_relay[$name]=$!
}
net_stop_relay () { # name
  [ -n "${net_relay[$1]:-}" ] || return 0
  kill -TERM "${net_relay[$1]}" 2>/dev/null || true
  wait "${net_relay[$1]}" 2>/dev/null || true
  net_relay[$1]=
}
net_no_faults () { # name
  net_stop_relay "$1"
  ip -n "$net_hub" link set "v${net_number[$1]}" master bridge
}

net_close () {
  [ -n "$net_prefix" ] || return 0
  local host pid hosts
  hosts=$(ip netns list | awk -v prefix="$net_prefix" 'index ($1, prefix) == 1 { print $1 }')
  for host in $hosts; do
    for pid in $(ip netns pids "$host" 2>/dev/null); do
      kill -KILL "$pid" 2>/dev/null || true
      wait "$pid" 2>/dev/null || true # so that the shell has nothing to say of it
    done
  done
  for host in $hosts; do ip netns del "$host" 2>/dev/null || true; done
  net_prefix= net_number=() net_relay=()
}
