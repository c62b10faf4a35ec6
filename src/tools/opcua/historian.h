/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Answers what clients read of the past: the service keeps some values of each drive for a week,
 * and the audit trail. One thread; a request waits for the service, some milliseconds at most.
 */
#ifndef DRIVEBRIDGE_OPCUA_HISTORIAN_H
#define DRIVEBRIDGE_OPCUA_HISTORIAN_H

#include "opcua/past.h"
#include "opcua/plant.h"
#include "opcua/roster.h"

#include <open62541/server.h>

struct db_opcua_historian {
	const struct db_opcua_roster *roster;
	struct db_opcua_plant *plant;
	struct db_opcua_past *past;
};

/* For the configuration of a server; the historian must outlive it. */
UA_HistoryDatabase db_opcua_historian_give(struct db_opcua_historian *historian);

#endif
