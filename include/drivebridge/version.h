/* SPDX-License-Identifier: Apache-2.0 */
/* The version, for the registers, the device identification and --version. */
#ifndef DRIVEBRIDGE_VERSION_H
#define DRIVEBRIDGE_VERSION_H

#define DB_VERSION_MAJOR 0
#define DB_VERSION_MINOR 10
#define DB_VERSION_PATCH 0

#define DB_VERSION_STRING_OF(number) #number
#define DB_VERSION_JOIN(major, minor, patch) \
	DB_VERSION_STRING_OF(major) "." DB_VERSION_STRING_OF(minor) "." DB_VERSION_STRING_OF(patch)
#define DB_VERSION DB_VERSION_JOIN(DB_VERSION_MAJOR, DB_VERSION_MINOR, DB_VERSION_PATCH)

#endif
