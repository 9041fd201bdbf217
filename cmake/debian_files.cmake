# Run by cpack before it packs: what Debian wants in every package, compressed man pages, and zsh's
# completion where packages have it.
foreach(component IN LISTS CPACK_COMPONENTS_ALL)
  string(TOUPPER ${component} upper)
  set(root "${CPACK_TEMPORARY_DIRECTORY}/${component}${CPACK_INSTALL_PREFIX}/share")
  set(doc "${root}/doc/${CPACK_DEBIAN_${upper}_PACKAGE_NAME}")
  file(MAKE_DIRECTORY "${doc}")
  file(READ "${CPACK_RESOURCE_FILE_LICENSE}" licence)
  string(REGEX REPLACE "\n\n" "\n.\n" licence "${licence}")
  string(REGEX REPLACE "\n" "\n " licence "${licence}")
  file(WRITE "${doc}/copyright" "Format: https://www.debian.org/doc/packaging-manuals/copyright-format/1.0/\n"
    "Upstream-Name: tutti\n\nFiles: *\nCopyright: ${CPACK_PACKAGE_VENDOR}\nLicense: BSD-3-Clause\n ${licence}\n")
  if(EXISTS "${root}/zsh/site-functions") # that folder is the administrator's
    file(RENAME "${root}/zsh/site-functions" "${root}/zsh/vendor-completions")
  endif()
  file(GLOB modules "${root}/../lib/python3.*/dist-packages")
  if(modules) # packages share one folder for all versions of Python 3
    file(MAKE_DIRECTORY "${root}/../lib/python3")
    file(RENAME "${modules}" "${root}/../lib/python3/dist-packages")
    cmake_path(GET modules PARENT_PATH versioned)
    file(REMOVE_RECURSE "${versioned}")
  endif()
  file(GLOB pages "${root}/man/man1/*.1")
  if(pages)
    execute_process(COMMAND gzip -9n ${pages} COMMAND_ERROR_IS_FATAL ANY)
  endif()
endforeach()
