/* SPDX-License-Identifier: Apache-2.0 */
/* Runs a scan of a bus to its end and returns the results. */
#ifndef DRIVEBRIDGE_CTL_SEARCH_H
#define DRIVEBRIDGE_CTL_SEARCH_H

#include "ctl/session.h"

struct db_ctl_search {
	json_t *finds;   /* an array of the interface's type Find; the caller frees both */
	json_t *foreign; /* Foreign */
	json_int_t wait_us;
	bool interrupted; /* by Ctrl-C; then the results until then */
};

/*
 * Takes the parameters of Scan over. DB_CTL_OK also when it was interrupted: the scan has then
 * ended with the connection, which is closed.
 */
enum db_ctl_status db_ctl_search(struct db_ctl *ctl, json_t *parameters,
                                 struct db_ctl_search *search);
void db_ctl_search_clear(struct db_ctl_search *search);

/* The bus of that name, or NULL and the reason is printed. */
const json_t *db_ctl_find_bus(const struct db_ctl *ctl, const char *name);

#endif
