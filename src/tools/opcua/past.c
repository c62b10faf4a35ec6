/* SPDX-License-Identifier: Apache-2.0 */
#include "opcua/past.h"
#include "opcua/history.h"
#include "opcua/record.h"
#include "opcua/trail.h"
#include "opcua/values.h"

#include "client/clock.h"
#include "client/link.h"

#include <poll.h>
#include <stdlib.h>
#include <string.h>

/* A result is kept for so long; within this time a search is not ended for another session's. */
#define KEPT (10 * DB_NS_PER_S)
#define OWN (1 * DB_NS_PER_S)

struct db_opcua_past {
	sd_event *loop;
	const struct db_opcua_config *config;
	const struct db_opcua_roster *roster;
	char server[DB_OPCUA_URI_MAX]; /* its URI */
	db_opcua_may_read_trail_fn *may;
	void *context;
	/* The search, and whose it is; `session` 0: none. */
	unsigned session;
	struct db_opcua_trail trail;
	struct db_opcua_trail_query query; /* as it was asked for */
	struct db_link *link;              /* NULL: it has ended */
	UA_StatusCode status;              /* of what has ended */
	db_time asked;                     /* for the last time */
};

struct db_opcua_past *db_opcua_past_new(sd_event *loop, const struct db_opcua_config *config,
                                        const struct db_opcua_roster *roster,
                                        db_opcua_may_read_trail_fn *may, void *context)
{
	struct db_opcua_past *past = calloc(1, sizeof(*past));

	if (!past)
		return NULL;
	past->loop = loop;
	past->config = config;
	past->roster = roster;
	db_opcua_config_server(config, past->server);
	past->may = may;
	past->context = context;
	return past;
}

static void end_search(struct db_opcua_past *past, UA_StatusCode status)
{
	struct db_link *link = past->link;

	past->status = status;
	past->link = NULL;
	db_link_drop(link);
}

static void forget_search(struct db_opcua_past *past)
{
	end_search(past, UA_STATUSCODE_GOOD);
	db_opcua_trail_clear(&past->trail);
	past->session = 0;
}

void db_opcua_past_free(struct db_opcua_past *past)
{
	if (!past)
		return;
	forget_search(past);
	free(past);
}

db_time db_opcua_past_tend(struct db_opcua_past *past, db_time now)
{
	if (past->session == 0)
		return DB_TIME_NEVER;
	if (now - past->asked < KEPT)
		return past->asked + KEPT;
	forget_search(past);
	return DB_TIME_NEVER;
}

/* --- searching -------------------------------------------------------------------------------- */

static void ask(struct db_opcua_past *past);

static void on_page(void *data, json_t *parameters, const struct db_client_error *error, bool more)
{
	struct db_opcua_past *past = data;

	(void)more;
	if (error)
		end_search(past, strcmp(error->name, DB_CLIENT_SERVICE "NotAllowed") == 0 ?
		                         UA_STATUSCODE_BADUSERACCESSDENIED :
		                         UA_STATUSCODE_BADNOCOMMUNICATION);
	else if (!db_opcua_trail_take(&past->trail, parameters))
		ask(past);
	else
		/* Without files there is no past. */
		end_search(past, past->trail.kept ? UA_STATUSCODE_GOOD :
		                                    UA_STATUSCODE_BADHISTORYOPERATIONUNSUPPORTED);
}

static void ask(struct db_opcua_past *past)
{
	json_t *question = db_opcua_trail_question(&past->trail);

	if (!question)
		end_search(past, UA_STATUSCODE_BADOUTOFMEMORY);
	else if (db_link_send(past->link, "Audit", question, false, on_page, past) != 0)
		end_search(past, UA_STATUSCODE_BADNOCOMMUNICATION);
}

static void lose_link(void *data)
{
	end_search(data, UA_STATUSCODE_BADNOCOMMUNICATION);
}

static UA_StatusCode begin_search(struct db_opcua_past *past, unsigned session,
                                  const struct db_opcua_trail_query *query)
{
	struct db_client_error error = { .parameters = NULL };

	forget_search(past);
	past->query = *query;
	past->session = session;
	if (!db_opcua_trail_begin(&past->trail, query)) {
		forget_search(past);
		return UA_STATUSCODE_BADOUTOFMEMORY;
	}
	past->link = db_link_open(past->loop, past->config->socket, lose_link, past, &error);
	db_client_error_clear(&error);
	if (!past->link) {
		forget_search(past);
		return UA_STATUSCODE_BADNOCOMMUNICATION;
	}
	ask(past);
	return UA_STATUSCODE_GOOD;
}

/* Good: past->trail has the result. */
static UA_StatusCode search(struct db_opcua_past *past, unsigned session,
                            const struct db_opcua_trail_query *query, db_time until)
{
	db_time now = db_client_now();
	bool known = past->session == session && memcmp(&past->query, query, sizeof(*query)) == 0;
	UA_StatusCode status = UA_STATUSCODE_GOOD;

	if (!known && past->session != 0 && past->session != session && now - past->asked < OWN)
		return UA_STATUSCODE_BADRESOURCEUNAVAILABLE;
	if (!known)
		status = begin_search(past, session, query);
	past->asked = now;
	if (status != UA_STATUSCODE_GOOD)
		return status;
	while (past->link && (now = db_client_now()) < until) {
		struct timespec patience = { .tv_nsec = until - now };
		struct pollfd place = db_link_poll_fd(past->link);

		if (ppoll(&place, 1, &patience, NULL) > 0)
			db_link_handle(past->link);
	}
	if (past->link)
		return UA_STATUSCODE_BADRESOURCEUNAVAILABLE;
	status = past->status;
	if (status != UA_STATUSCODE_GOOD)
		forget_search(past);
	return status;
}

/* --- answering -------------------------------------------------------------------------------- */

/* The drive of a node, "" of those with everything. False: it has no past events. */
static bool find_drive(const struct db_opcua_past *past, const UA_NodeId *node, const char **drive)
{
	static const UA_NodeId server = { .identifier.numeric = UA_NS0ID_SERVER };
	struct db_opcua_subject subject;

	*drive = "";
	if (UA_NodeId_equal(node, &server))
		return true;
	if (node->namespaceIndex != past->roster->space ||
	    node->identifierType != UA_NODEIDTYPE_STRING ||
	    !db_opcua_roster_identify(past->roster, (const char *)node->identifier.string.data,
	                              node->identifier.string.length, &subject))
		return false;
	if (subject.type == DB_OPCUA_ALL_DRIVES)
		return true;
	if (subject.type != DB_OPCUA_OF_DRIVE || subject.shown->gateway ||
	    subject.branch->type != DB_OPCUA_ROOT)
		return false;
	*drive = subject.shown->name;
	return true;
}

static UA_StatusCode give_records(const struct db_opcua_past *past, const UA_EventFilter *filter,
                                  UA_HistoryReadResult *result, UA_HistoryEvent *events)
{
	const json_t *found = past->trail.found;
	int64_t after = past->trail.after;
	size_t count = json_array_size(found);
	UA_StatusCode status = UA_STATUSCODE_GOOD;

	if (count == 0)
		return UA_STATUSCODE_GOODNODATA;
	if (!db_opcua_record_is_wanted(past->roster, &filter->whereClause))
		return UA_STATUSCODE_GOODNODATA;
	events->events = UA_Array_new(count, &UA_TYPES[UA_TYPES_HISTORYEVENTFIELDLIST]);
	if (!events->events)
		return UA_STATUSCODE_BADOUTOFMEMORY;
	events->eventsSize = count;
	for (size_t i = 0; i < count && status == UA_STATUSCODE_GOOD; i++)
		status = db_opcua_record_fill(past->roster, past->server, json_array_get(found, i),
		                              filter, &events->events[i]);
	if (status != UA_STATUSCODE_GOOD || after == 0)
		return status;
	status = UA_ByteString_allocBuffer(&result->continuationPoint, sizeof(after));
	if (status == UA_STATUSCODE_GOOD)
		memcpy(result->continuationPoint.data, &after, sizeof(after));
	return status;
}

UA_StatusCode db_opcua_past_read(struct db_opcua_past *past, const UA_NodeId *session,
                                 const UA_ReadEventDetails *details,
                                 const UA_HistoryReadValueId *wanted, db_time until,
                                 UA_HistoryReadResult *result, UA_HistoryEvent *events)
{
	struct db_opcua_history_query range = { .start_us = db_opcua_us_of(details->startTime),
		                                .end_us = db_opcua_us_of(details->endTime),
		                                .most = details->numValuesPerNode };
	const UA_ByteString *after = &wanted->continuationPoint;
	struct db_opcua_trail_query query;
	const char *drive;
	unsigned number = 0;
	UA_StatusCode status;

	if (!find_drive(past, &wanted->nodeId, &drive))
		return UA_STATUSCODE_BADHISTORYOPERATIONUNSUPPORTED;
	status = past->may(past->context, session, drive, &number);
	if (status == UA_STATUSCODE_GOOD)
		status = db_opcua_record_check(&details->filter);
	if (status != UA_STATUSCODE_GOOD)
		return status;
	if (!db_opcua_history_is_valid(&range))
		return UA_STATUSCODE_BADHISTORYOPERATIONINVALID;
	/* Two that mean the same are equal as bytes. */
	memset(&query, 0, sizeof(query));
	strncpy(query.drive, drive, sizeof(query.drive) - 1);
	query.start_us = range.start_us;
	query.end_us = range.end_us;
	query.most = range.most;
	if (after->length != 0 && after->length != sizeof(query.after))
		return UA_STATUSCODE_BADCONTINUATIONPOINTINVALID;
	if (after->length != 0)
		memcpy(&query.after, after->data, sizeof(query.after));
	if (query.after < 0)
		return UA_STATUSCODE_BADCONTINUATIONPOINTINVALID;
	status = search(past, number, &query, until);
	if (status != UA_STATUSCODE_GOOD)
		return status;
	status = give_records(past, &details->filter, result, events);
	forget_search(past);
	return status;
}
