// Bytes as text (RFC 4648).
#pragma once

#include <cstddef>
#include <string>

namespace tutti {

std::string Base64(const void* bytes, std::size_t size);

}  // namespace tutti
