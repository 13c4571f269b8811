#!/usr/bin/env bash
# Builds the images of the Dockerfile, and tries them.
set -euo pipefail
# shellcheck source=scripts/common.sh
source "$(dirname "$(readlink -f "${BASH_SOURCE[0]}")")/common.sh"
# shellcheck source=scripts/roots.sh
source "$root/scripts/roots.sh"

usage() {
  cat <<'END'
usage: scripts/container.sh [--lint] [development|node]

Checks the Dockerfile and .devcontainer/devcontainer.json, then builds that stage of the Dockerfile (by
default development) with Debian's buildah, and tries it: in development, what .devcontainer runs after it has
made a container; in node, a launch of the simulated rig. Nothing comes from a registry of images: the
image debian:bookworm is made with debootstrap. Needs root. What is stored lies in ~/.cache/stepdriver/images
(or in the folder that STEPDRIVER_IMAGES names) until it is removed by hand. Exit status 77, with the
reason, if buildah can't be installed.

  --lint  only checks these two files
END
}

target=development lint=
for argument; do
  case $argument in
    --lint) lint=1 ;;
    development | node) target=$argument ;;
    -h | --help) usage && exit ;;
    *) usage >&2 && exit 2 ;;
  esac
done

# ---- the files ----

# Each RUN must be a shell command without findings, each COPY of the checkout must exist, and the container
# of an editor must be a stage.
check_files() {
  /usr/bin/python3 -B - "$root" <<'END'
import json, pathlib, re, subprocess, sys

root = pathlib.Path(sys.argv[1])
text = re.sub(r"^#.*\n", "", (root / "Dockerfile").read_text(encoding="utf-8"), flags=re.MULTILINE)
stages, wrong = [], []
for line in text.replace("\\\n", " ").splitlines():
    word, _, rest = line.partition(" ")
    if word == "FROM":
        stages.append(rest.split()[-1])
    elif word == "COPY":
        options = [each for each in rest.split() if each.startswith("--")]
        sources = [each for each in rest.split() if not each.startswith("--")][:-1]
        origin = [each.split("=")[1] for each in options if each.startswith("--from=")]
        wrong += [f"COPY: there is no stage {each}" for each in origin if each not in stages[:-1]]
        wrong += [f"COPY: there is no {each}" for each in sources
                  if not origin and not (root / each).exists()]
    elif word == "RUN":
        found = subprocess.run(["shellcheck", "--shell=bash", "--exclude=SC2046", "-"], check=False,
                               input=f"set -o pipefail\n{rest}\n", text=True, capture_output=True)
        wrong += [found.stdout] if found.returncode else []
container = json.loads((root / ".devcontainer/devcontainer.json").read_text(encoding="utf-8"))
if container["build"]["target"] not in stages:
    wrong.append(f".devcontainer: the Dockerfile has no stage {container['build']['target']}")
print("\n".join(wrong) or f"Dockerfile and .devcontainer: no findings in the stages {', '.join(stages)}.")
sys.exit(bool(wrong))
END
}
choose_build_folder
install_packages lint
check_files
[[ -z $lint ]] || exit 0

# ---- the image ----

(($(id -u) == 0)) || die "needs root, for debootstrap and chroot"
# In a process of its own, because it ends the shell if it fails.
(install_packages images) >&2 || {
  say "container.sh: the image can not be built here: buildah can't be installed" >&2
  exit 77
}

images=${STEPDRIVER_IMAGES:-${XDG_CACHE_HOME:-${HOME:-/root}/.cache}/stepdriver/images}
# Without namespaces and mounts of its own, as it must work in a container too.
build_images() { buildah --root "$images" --runroot "$images/run" --storage-driver vfs "$@"; }

make_base_image() {
  local container mounted
  build_images rmi --force debian:bookworm >/dev/null 2>&1 || true
  container=$(build_images from scratch) && mounted=$(build_images mount "$container") &&
    cp -a "$base/." "$mounted/" && connect_root "$mounted" &&
    build_images config --cmd /bin/bash "$container" &&
    build_images commit --rm "$container" debian:bookworm
}
build_target() {
  build_images bud --format docker --isolation chroot --pull-never --layers=false --target "$target" \
    -t "stepdriver:$target" -f "$root/Dockerfile" "$root"
}

mkdir -p "$images"
make_base_root bookworm
start=$SECONDS
say "Making the image debian:bookworm"
quietly container-base make_base_image
say "Building the stage $target (tail -f $build/log/container-build.log)"
quietly container-build build_target

# ---- trying it ----

container=
remove_container() { [[ -z $container ]] || build_images rm "$container" >/dev/null 2>&1; }
at_exit remove_container
container=$(build_images from --pull-never "stepdriver:$target")
in_container() { build_images run --isolation chroot "$@"; }

# As an editor does: the checkout in the container, and then its postCreateCommand.
try_development() {
  local after
  after=$(/usr/bin/python3 -c 'import json, sys; print(json.load(open(sys.argv[1]))["postCreateCommand"])' \
    "$root/.devcontainer/devcontainer.json")
  tar -C "$root" --exclude=./build --exclude=./.git -c . |
    in_container "$container" -- bash -euc 'mkdir stepdriver; tar -C stepdriver --no-same-owner -x'
  in_container "$container" -- bash -euc "
    sudo -n true
    cd stepdriver
    git init -q
    $after
    cmake --build --preset dev -j $jobs --target stepdriver_generate_messages"
}
# roslaunch ends by the interrupt after its start, in order. Docker lets a container find itself by its name, but
# this isolation doesn't.
try_node() {
  in_container "$container" -- bash -euc '
    ROS_IP=127.0.0.1 timeout --signal=INT 30 roslaunch stepdriver axis.launch || (($? == 124))' \
    >"$build/log/container-launch.log" 2>&1
  grep -F 'Ready: 1 axis' "$build/log/container-launch.log"
}
quietly container-try "try_$target"
say "The stage $target works: built and tried in $((SECONDS - start)) s," \
  "    $(in_container "$container" -- dpkg-query -W | wc -l) packages."
