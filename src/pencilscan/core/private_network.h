#pragma once

namespace pencilscan {

/// Moves this process into a network of its own: only a loopback interface, with 127.0.0.1 to
/// 127.0.0.<addresses>, that nobody else reaches and that reaches nobody. Needs no rights where the
/// kernel lets users have namespaces. Sockets that are open already stay in the network outside.
/// This process must have one thread only; its children live in the network, too. StageError when
/// the kernel refuses.
void enter_private_network(int addresses);

}  // namespace pencilscan
