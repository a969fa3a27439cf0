# SPDX-License-Identifier: MIT
# For arm64 Linux with Debian's cross compiler.  Libraries come from a folder that
# launch/arm64/sysroot fills: -DANLOS_SYSROOT=FOLDER.  Tests run under qemu-user.
set(CMAKE_SYSTEM_NAME Linux)
set(CMAKE_SYSTEM_PROCESSOR aarch64)
set(CMAKE_C_COMPILER aarch64-linux-gnu-gcc)
set(CMAKE_LIBRARY_ARCHITECTURE aarch64-linux-gnu)

list(APPEND CMAKE_TRY_COMPILE_PLATFORM_VARIABLES ANLOS_SYSROOT)
if(NOT IS_DIRECTORY "${ANLOS_SYSROOT}/usr/lib/aarch64-linux-gnu")
    message(FATAL_ERROR "ANLOS_SYSROOT '${ANLOS_SYSROOT}' holds no libraries for arm64: give "
        "-DANLOS_SYSROOT=FOLDER, the folder that launch/arm64/sysroot prints")
endif()
set(CMAKE_SYSROOT ${ANLOS_SYSROOT})
set(CMAKE_FIND_ROOT_PATH ${ANLOS_SYSROOT})
set(CMAKE_FIND_ROOT_PATH_MODE_PROGRAM NEVER)
set(CMAKE_FIND_ROOT_PATH_MODE_LIBRARY ONLY)
set(CMAKE_FIND_ROOT_PATH_MODE_INCLUDE ONLY)
set(CMAKE_FIND_ROOT_PATH_MODE_PACKAGE ONLY)
set(ENV{PKG_CONFIG_SYSROOT_DIR} ${ANLOS_SYSROOT})
set(ENV{PKG_CONFIG_LIBDIR}
    ${ANLOS_SYSROOT}/usr/lib/aarch64-linux-gnu/pkgconfig:${ANLOS_SYSROOT}/usr/share/pkgconfig)
set(ENV{PKG_CONFIG_PATH} "")
set(CMAKE_CROSSCOMPILING_EMULATOR qemu-aarch64 -L ${ANLOS_SYSROOT})
set(CPACK_DEBIAN_PACKAGE_ARCHITECTURE arm64)
