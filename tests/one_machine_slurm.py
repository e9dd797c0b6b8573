"""Slurm with several nodes on this one machine, to try jobs on; nothing of it outlives stop()."""

import os
import shutil
import signal
import socket
import subprocess
import time

PROGRAMS = ("slurmctld", "slurmd", "sbatch", "munged")
PATH = os.environ["PATH"] + ":/usr/sbin:/sbin"


def is_possible():
    """Slurm starts daemons of its own user; as root that is anybody."""
    return os.geteuid() == 0 and all(shutil.which(p, path=PATH) for p in PROGRAMS)


def free_port():
    with socket.socket() as s:
        s.bind(("", 0))
        return s.getsockname()[1]


class Slurm:
    """`nodes` slurmd of two CPUs each, under one slurmctld; all that they write is in `folder`."""

    def __init__(self, folder, nodes=3):
        self.folder = folder
        self.names = [f"n{i + 1}" for i in range(nodes)]
        self.ports = {name: free_port() for name in self.names}
        self.daemons = {}
        os.makedirs(folder, exist_ok=True)
        os.chmod(folder, 0o755)
        self.environment = {**os.environ, "PATH": PATH, "SLURM_CONF": f"{folder}/slurm.conf"}

    def write_configuration(self):
        host = socket.gethostname()
        lines = [
            "ClusterName=one", f"SlurmctldHost={host}(127.0.0.1)", f"SlurmctldPort={free_port()}",
            "SlurmUser=root", "SlurmdUser=root", "AuthType=auth/munge",
            f"AuthInfo=socket={self.folder}/munge.socket",
            "CredType=cred/munge", "ProctrackType=proctrack/linuxproc", "TaskPlugin=task/none",
            "JobAcctGatherType=jobacct_gather/none", "SelectType=select/cons_tres",
            "SelectTypeParameters=CR_Core", "SchedulerType=sched/backfill",
            # Nodes that vanish are noticed at once, and their tasks wait for nothing.
            "SlurmdTimeout=5", "KillWait=2", "MinJobAge=300", "ReturnToService=2",
            "SlurmdParameters=config_overrides", "MpiDefault=none",
            f"StateSaveLocation={self.folder}/state", f"SlurmdSpoolDir={self.folder}/spool.%n",
            f"SlurmctldPidFile={self.folder}/slurmctld.pid",
            f"SlurmdPidFile={self.folder}/slurmd.%n.pid",
            f"SlurmctldLogFile={self.folder}/slurmctld.log",
            f"SlurmdLogFile={self.folder}/slurmd.%n.log",
        ]
        for name in self.names:
            lines.append(f"NodeName={name} NodeHostname={host} NodeAddr=127.0.0.1 "
                         f"Port={self.ports[name]} CPUs=1 State=UNKNOWN")
        lines.append(f"PartitionName=all Nodes={','.join(self.names)} Default=YES State=UP")
        with open(f"{self.folder}/slurm.conf", "w") as f:
            f.write("\n".join(lines) + "\n")
        with open(f"{self.folder}/cgroup.conf", "w") as f:
            f.write("IgnoreSystemd=yes\n")

    def start(self):
        self.write_configuration()
        os.makedirs(f"{self.folder}/state", exist_ok=True)
        key = f"{self.folder}/munge.key"
        with open(key, "wb") as f:
            f.write(os.urandom(1024))
        os.chmod(key, 0o600)
        self.daemon("munged", ["munged", "--foreground", "--force", f"--key-file={key}",
                               f"--socket={self.folder}/munge.socket",
                               f"--pid-file={self.folder}/munged.pid",
                               f"--log-file={self.folder}/munged.log",
                               f"--seed-file={self.folder}/munged.seed"])
        self.wait_for(lambda: os.path.exists(f"{self.folder}/munge.socket"), "munged")
        self.daemon("slurmctld", ["slurmctld", "-D", "-c"])
        for name in self.names:
            self.start_node(name)
        self.wait_for(lambda: self.idle_nodes() == len(self.names), "the nodes", 60)

    def start_node(self, name):
        self.daemon(name, ["slurmd", "-D", "-N", name])

    def daemon(self, name, command):
        log = open(f"{self.folder}/{name}.out", "ab")
        self.daemons[name] = subprocess.Popen(command, env=self.environment, stdout=log,
                                              stderr=log, start_new_session=True)
        log.close()

    def run(self, *command):
        return subprocess.run(command, env=self.environment, capture_output=True, text=True)

    def start_again_at_once(self):
        """Slurm waits two minutes before it starts a task again whose node was lost."""
        for job in self.run("squeue", "-h", "-r", "-t", "PD", "-o", "%i,%r").stdout.split():
            if job.endswith(",BeginTime"):
                self.run("scontrol", "update", f"JobId={job.split(',')[0]}", "StartTime=now")

    def idle_nodes(self):
        return self.run("sinfo", "-h", "-N", "-o", "%t").stdout.split().count("idle")

    def kill_node(self, name):
        """As when its power fails: the daemon and what it runs are gone."""
        daemon = self.daemons.pop(name)
        for pid in self.below(daemon.pid) + [daemon.pid]:
            try:
                os.kill(pid, signal.SIGKILL)
            except ProcessLookupError:
                pass
        daemon.wait()
        # Tasks hang on slurmstepd, which leaves the daemon's tree: they carry the node's name.
        for pid in os.listdir("/proc"):
            if pid.isdigit() and self.is_of_node(pid, name):
                os.kill(int(pid), signal.SIGKILL)

    def is_of_node(self, pid, name):
        try:
            with open(f"/proc/{pid}/environ", "rb") as f:
                words = f.read().split(b"\0")
        except OSError:
            return False
        return (f"SLURMD_NODENAME={name}".encode() in words and
                f"SLURM_CONF={self.folder}/slurm.conf".encode() in words)

    @staticmethod
    def below(pid):
        found = subprocess.run(["ps", "-o", "pid=", "--ppid", str(pid)], capture_output=True,
                               text=True).stdout.split()
        return [p for child in found for p in [int(child)] + Slurm.below(int(child))]

    @staticmethod
    def wait_for(condition, what, seconds=30):
        end = time.time() + seconds
        while not condition():
            if time.time() > end:
                raise TimeoutError(f"{what}: not there after {seconds} s")
            time.sleep(0.2)

    def stop(self):
        for name in list(self.daemons):
            daemon = self.daemons.pop(name)
            daemon.send_signal(signal.SIGTERM)
            try:
                daemon.wait(10)
            except subprocess.TimeoutExpired:
                daemon.kill()
                daemon.wait()
