#!/usr/bin/env bash
# Every rosdep key of package.xml stands in scripts/debian_packages.txt, and the Debian packages
# behind it are installed; every key of that list is used by package.xml.
set -euo pipefail
root=$(cd "$(dirname "$0")/.." && pwd)
list=$root/scripts/debian_packages.txt
keys=$(sed -nE 's#.*<([a-z_]*depend)>([^<]+)</\1>.*#\2#p' "$root/package.xml" | sort -u)
[ "$(wc -l <<<"$keys")" -ge 20 ] ||
  { echo "only $(wc -l <<<"$keys") keys found in package.xml"; exit 1; }
status=0
for key in $keys; do
  packages=$(awk -v key="$key" '$1 == key { $1 = ""; print }' "$list")
  if [ -z "$packages" ]; then
    echo "package.xml: key '$key' is missing in scripts/debian_packages.txt"
    status=1
  fi
  # rviz is for eyes only and not needed to build or test: known to apt is enough.
  wanted=installed
  [ "$key" != rviz ] || wanted=known
  for package in $packages; do
    if [ $wanted = known ]; then
      apt-cache show "$package" >/dev/null 2>&1 || { echo "no Debian package '$package'"; status=1; }
    elif [ "$(dpkg-query -W -f '${db:Status-Status}' "$package" 2>/dev/null)" != installed ]; then
      echo "key '$key': Debian package '$package' is not installed"
      status=1
    fi
  done
done
for key in $(awk '!/^#/ && !/^\[/ && NF && $1 != "-" { print $1 }' "$list"); do
  grep -qx "$key" <<<"$keys" ||
    { echo "debian_packages.txt: '$key' is no key of package.xml"; status=1; }
done
exit $status
