// Machines of their own for processes, as far as the network goes: two namespaces with a link between them.
#pragma once

#include <unistd.h>

#include <cstdlib>
#include <string>
#include <vector>

namespace dpr::test {

/// Network namespaces 0 and 1, with the addresses 10.213.7.1 and 10.213.7.2. They need root and the program
/// ip.
class Network {
 public:
  Network() {
    const std::string link = "type veth peer name " + interface(1) + " netns " + name(1);
    is_made_ = run("ip netns add " + name(0)) && run("ip netns add " + name(1)) &&
               run("ip -n " + name(0) + " link add " + interface(0) + " " + link) && set_up(0) && set_up(1);
  }
  ~Network() {
    for (const int machine : {0, 1}) run("ip netns delete " + name(machine));
  }
  Network(const Network&) = delete;
  Network& operator=(const Network&) = delete;

  /// True if this machine allowed the network.
  bool is_made() const { return is_made_; }
  static std::string address(int machine) { return "10.213.7." + std::to_string(1 + machine); }
  /// Prefix of a command line that runs there.
  std::vector<std::string> prefix(int machine) const { return {"ip", "netns", "exec", name(machine)}; }
  /// From now on everything that is sent is lost, and nobody is told.
  bool cut() const { return run("ip -n " + name(1) + " link set " + interface(1) + " down"); }
  bool restore() const { return run("ip -n " + name(1) + " link set " + interface(1) + " up"); }

 private:
  static bool run(const std::string& line) { return std::system((line + " >/dev/null 2>&1").c_str()) == 0; }

  std::string name(int machine) const { return "dpr-" + std::to_string(id_) + "-" + std::to_string(machine); }
  std::string interface(int machine) const { return "dpr" + std::to_string(machine); }
  bool set_up(int machine) const {
    const std::string in = "ip -n " + name(machine) + " ";
    return run(in + "address add " + address(machine) + "/24 dev " + interface(machine)) &&
           run(in + "link set lo up") && run(in + "link set " + interface(machine) + " up");
  }

  pid_t id_ = getpid();
  bool is_made_ = false;
};

}  // namespace dpr::test
