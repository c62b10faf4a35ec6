/* SPDX-License-Identifier: Apache-2.0 */
/* The role in a certificate's extension, as Modbus/TCP Security has it. Pure. */
#ifndef DRIVEBRIDGE_TLS_ROLE_H
#define DRIVEBRIDGE_TLS_ROLE_H

#include "codec/secure_hello.h"

#define DB_TLS_ROLE_OID "1.3.6.1.4.1.50316.802.1"

/*
 * Reads the extension's value: one UTF8String of 1 to 32 bytes of visible ASCII, and nothing behind
 * it. False for anything else: it is no role then, and `role` is "".
 */
bool db_tls_role_read(const uint8_t *value, size_t size, char role[DB_SECURE_ROLE_MAX + 1]);

#endif
