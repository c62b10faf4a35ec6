/* SPDX-License-Identifier: Apache-2.0 */
/* A scan of a bus that is waited for, with what it found. */
#ifndef DRIVEBRIDGE_CTL_SEARCH_H
#define DRIVEBRIDGE_CTL_SEARCH_H

#include "ctl/session.h"

struct db_ctl_search {
	json_t *finds;   /* of the interface's type Find; the caller frees both */
	json_t *foreign; /* Foreign */
	json_int_t wait_us;
	bool interrupted; /* Ctrl-C: what was found until then */
};

/*
 * Takes the parameters of Scan over. DB_CTL_OK also when it was interrupted: the scan then has ended with the
 * connection, which is closed.
 */
enum db_ctl_status db_ctl_search(struct db_ctl *ctl, json_t *parameters,
                                 struct db_ctl_search *search);
void db_ctl_search_clear(struct db_ctl_search *search);

/* The bus of that name, or NULL and the reason is printed. */
const json_t *db_ctl_find_bus(const struct db_ctl *ctl, const char *name);

#endif
