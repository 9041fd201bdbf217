// Who may look at the live view.
#pragma once

#include <string>

namespace tutti::view {

/// 127.0.0.0/8, ::1 and localhost.
bool IsLoopback(const std::string& address);

/// 128 random bits from the system, in hex.
std::string RandomToken();

/// True if both are the same; takes as long for any two of one length.
bool SameToken(const std::string& a, const std::string& b);

/// True if the header Host names this machine: another site's name that was made to point here (DNS
/// rebinding) does not.
bool NamesLoopback(const std::string& host_header);

}  // namespace tutti::view
