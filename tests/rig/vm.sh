#!/bin/bash
# Run a command in a throw-away machine that has a kernel and devices of its own; its output is ours, and its exit code.
#
#   tests/rig/vm.sh [-t SECONDS] COMMAND...
#
# QEMU emulates the machine in software, so no /dev/kvm and no privilege over this kernel is needed. The kernel is
# Debian's. This machine's root is its root, read-only with a layer in memory above it; the project is shared for
# writing. It has no network. On board: two CAN controllers on one bus, and a USB serial adapter (FTDI) with its other
# end at a virtio port.
#
# Exit: the command's code; 124 out of time, 125 the machine died, 126 something is missing here.
set -euo pipefail

PROJECT=$(realpath "$(dirname "$0")/../..")
CACHE=${XDG_CACHE_HOME:-$HOME/.cache}/shadebus-rig # what was downloaded and made once: kernel, modules, first root
ROOT_SHARE="trans=virtio,version=9p2000.L,msize=262144"
LIMIT_S=600

die() {
  echo "vm.sh: $*" >&2
  exit 126
}

# Its standard output belongs to the command.
apt() {
  apt-get -q -y "$@" >&2
}

install_tools() {
  local missing=()
  command -v qemu-system-x86_64 >/dev/null || missing+=(qemu-system-x86)
  [ -x /bin/busybox ] || missing+=(busybox-static)
  command -v cpio >/dev/null || missing+=(cpio)
  command -v depmod >/dev/null || missing+=(kmod)
  command -v ip >/dev/null || missing+=(iproute2)
  [ ${#missing[@]} -gt 0 ] || return 0
  command -v apt-get >/dev/null || die "install ${missing[*]} first; only Debian's apt-get is known here"
  export DEBIAN_FRONTEND=noninteractive
  apt update || die "apt-get update failed, and ${missing[*]} are missing"
  apt install --no-install-recommends "${missing[@]}" || die "apt-get install ${missing[*]} failed (are you root?)"
}

kernel_package() {
  apt-cache depends linux-image-amd64 2>/dev/null | sed -n 's/.*Depends: \(linux-image-[0-9].*\)/\1/p' | head -n 1
}

# Unpack Debian's kernel and make the small root that it starts from. Nothing is installed on this machine.
make_kernel() {
  local new=$CACHE/new package version
  package=$(kernel_package)
  [ -n "$package" ] || { apt update && package=$(kernel_package); } || true
  [ -n "$package" ] || die "no package linux-image-amd64: this needs Debian's packages for x86-64"
  version=${package#linux-image-}
  rm -rf "$new"
  mkdir -p "$new/download" "$new/kernel"
  (cd "$new/download" && apt-get -q -o APT::Sandbox::User=root download "$package" >&2) || die "apt-get download $package failed"
  dpkg -x "$new"/download/*.deb "$new/kernel"
  rm -rf "$new/download"
  depmod -b "$new/kernel" "$version"
  unpack_image "$new/kernel/boot/vmlinuz-$version" "$new/vmlinuz"
  make_first_root "$new" "$version"
  rm -rf "$CACHE/current"
  mv "$new" "$CACHE/current"
}

# QEMU starts the ELF file inside the image at once: no BIOS, and nothing to unpack at a tenth of the speed.
unpack_image() {
  python3 - "$1" "$2" <<'PYTHON'
import lzma, pathlib, sys

image = pathlib.Path(sys.argv[1]).read_bytes()
kernel = lzma.LZMADecompressor().decompress(image[image.index(b"\xfd7zXZ\0") :])
assert kernel[:4] == b"\x7fELF"
pathlib.Path(sys.argv[2]).write_bytes(kernel)
PYTHON
}

make_first_root() {
  local root=$1/first version=$2 module
  mkdir -p "$root"/{bin,dev,proc,sys,lower,upper,new,modules}
  cp /bin/busybox "$root/bin/busybox"
  for module in virtio_pci virtio_console 9pnet_virtio 9p overlay; do
    modprobe -d "$1/kernel" -S "$version" --show-depends "$module"
  done | awk '$1 == "insmod" && !seen[$2]++ { print $2 }' | while read -r module; do
    cp "$module" "$root/modules/"
    basename "$module" >>"$root/modules/order"
  done
  cat >"$root/init" <<INIT
#!/bin/busybox sh
b=/bin/busybox
\$b mount -t proc proc /proc; \$b mount -t sysfs sysfs /sys; \$b mount -t devtmpfs dev /dev
while read module; do \$b insmod /modules/\$module; done < /modules/order
halt() { echo "init: \$*" > /dev/kmsg; \$b poweroff -f; }
\$b mount -t 9p -o $ROOT_SHARE,cache=loose,ro host_root /lower || halt "no root"
\$b mount -t tmpfs upper /upper; \$b mkdir /upper/files /upper/work
\$b mount -t overlay -o lowerdir=/lower,upperdir=/upper/files,workdir=/upper/work overlay /new || halt "no overlay"
\$b mkdir -p /new/vm /new/usr/lib/modules
\$b mount -t 9p -o $ROOT_SHARE,cache=none,rw vm /new/vm || halt "no share of this run"
. /new/vm/places
\$b mkdir -p "/new\$PROJECT"
\$b mount -t 9p -o $ROOT_SHARE,cache=loose,rw project "/new\$PROJECT" || halt "no project"
\$b mount --bind "/lower\$KERNEL/lib/modules" /new/usr/lib/modules || halt "no modules"
\$b mount -t proc proc /new/proc; \$b mount -t sysfs sysfs /new/sys; \$b mount -t devtmpfs dev /new/dev
\$b mkdir -p /new/dev/pts /new/dev/shm
\$b mount -t devpts -o ptmxmode=666 devpts /new/dev/pts; \$b mount -t tmpfs shm /new/dev/shm
\$b mount -t tmpfs run /new/run
\$b stty -F /dev/hvc0 raw -echo
exec </dev/null >/dev/hvc0 2>&1
\$b chroot /new /bin/bash /vm/start; echo \$? > /new/vm/exit_code
\$b sync; \$b poweroff -f
INIT
  chmod +x "$root/init"
  (cd "$root" && find . | cpio -o -H newc --quiet) >"$1/initrd"
  rm -rf "$root"
}

share() {
  echo "-fsdev local,id=$1,path=$2,security_model=none,multidevs=remap${3:-} -device virtio-9p-pci,fsdev=$1,mount_tag=$1"
}

while getopts t: option; do
  case $option in
    t) LIMIT_S=$OPTARG ;;
    *) exit 126 ;;
  esac
done
shift $((OPTIND - 1))
[ $# -gt 0 ] || die "say which command to run"

mkdir -p "$CACHE"
exec 9>"$CACHE/lock"
flock 9 # two runs at once prepare one after the other
install_tools
[ -e "$CACHE/current" ] || make_kernel
exec 9>&-

run=$(mktemp -d)
qemu=
trap '[ -z "$qemu" ] || kill "$qemu" 2>/dev/null; rm -rf "$run"' EXIT
trap 'exit 130' INT TERM
printf 'PROJECT=%q\nKERNEL=%q\n' "$PROJECT" "$CACHE/current/kernel" >"$run/places"
{
  echo 'export HOME=/root PATH=/usr/local/sbin:/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin RIG_VM=1'
  echo 'ip link set lo up; modprobe configfs; mount -t configfs none /sys/kernel/config'
  printf 'cd %q || exit 125\n' "$PROJECT"
  printf '%q ' "$@"
} >"$run/start"

# shellcheck disable=SC2046 # each share is several words
timeout -k 5 "$LIMIT_S" qemu-system-x86_64 \
  -accel tcg,thread=multi,tb-size=256 -M q35,usb=off,vmport=off -cpu max -m 1G -smp 2 \
  -nodefaults -no-user-config -display none -no-reboot -nic none \
  -kernel "$CACHE/current/vmlinuz" -initrd "$CACHE/current/initrd" \
  -append "console=ttyS0 quiet loglevel=4 panic=-1 mitigations=off tsc=reliable random.trust_cpu=on" \
  -serial "file:$run/kernel.log" -device virtio-rng-pci \
  -device virtio-serial-pci -chardev stdio,id=out,signal=off -device virtconsole,chardev=out \
  $(share host_root / ,readonly=on) $(share vm "$run") $(share project "$PROJECT") \
  -object can-bus,id=bus -device kvaser_pci,canbus=bus -device kvaser_pci,canbus=bus \
  -chardev "socket,id=near,path=$run/ftdi,server=on,wait=off" -device qemu-xhci -device usb-serial,chardev=near \
  -chardev "socket,id=far,path=$run/ftdi" -device virtserialport,chardev=far,name=ftdi \
  </dev/null &
qemu=$!
ended=0
wait "$qemu" || ended=$?
qemu=

[ ! -s "$run/exit_code" ] || exit "$(cat "$run/exit_code")"
tail -n 5 "$run/kernel.log" >&2 || true
case $ended in
  124 | 137) echo "vm.sh: not done within $LIMIT_S s" >&2; exit 124 ;;
  *) echo "vm.sh: the machine ended without an exit code" >&2; exit 125 ;;
esac
