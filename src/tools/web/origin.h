/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Checks that a request is meant for this gateway and was made by its own page. A foreign page
 * whose name a name server points to this address (DNS rebinding) has another Host; a page that
 * sends a request across sites has its own Origin. Pure.
 */
#ifndef DRIVEBRIDGE_WEB_ORIGIN_H
#define DRIVEBRIDGE_WEB_ORIGIN_H

#include "reader/settings.h"

#include <stdbool.h>

/* The Host header: an address, localhost, or one of the names; with or without a port. NULL: there
 * is none. */
bool db_web_host_is_good(const char *host, const struct db_setting_list *names);

/* The Origin header, if there is one, has to match the Host. */
bool db_web_origin_is_good(const char *origin, const char *host);

#endif
