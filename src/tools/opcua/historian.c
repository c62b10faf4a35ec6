/* SPDX-License-Identifier: Apache-2.0 */
#include "opcua/historian.h"
#include "opcua/history.h"
#include "opcua/values.h"

#include "client/clock.h"

#include <stdlib.h>
#include <string.h>

/* Most nodes of a request, and how long it waits for the service: everybody's stops wait as long.
 */
#define NODES_MAX 16
#define WAIT_MAX_MS 30

/* What the service has told of the drive that was read last in this request. */
struct told {
	const struct db_opcua_shown *shown;
	int64_t since_us;
	json_t *answer;
	db_time until;
};

/* The register that is read; NULL: none whose values are kept. */
static const struct db_opcua_register *find_register(const struct db_opcua_roster *roster,
                                                     const UA_NodeId *node,
                                                     struct db_opcua_subject *subject)
{
	const struct db_opcua_register *reg;

	if (node->namespaceIndex != roster->space || node->identifierType != UA_NODEIDTYPE_STRING ||
	    !db_opcua_roster_identify(roster, (const char *)node->identifier.string.data,
	                              node->identifier.string.length, subject) ||
	    subject->type != DB_OPCUA_OF_DRIVE || subject->shown->gateway ||
	    subject->branch->type != DB_OPCUA_VARIABLE)
		return NULL;
	reg = &subject->shown->tree->kind->list[subject->branch->place];
	return db_opcua_history_field(reg->name) ? reg : NULL;
}

static const json_t *ask(const struct db_opcua_historian *historian, struct told *told,
                         const struct db_opcua_shown *shown, int64_t since_us)
{
	db_time left = told->until - db_client_now();

	if (told->shown != shown || told->since_us != since_us) {
		json_decref(told->answer);
		told->answer = NULL;
		told->shown = shown;
		told->since_us = since_us;
		if (left > 0)
			told->answer = db_opcua_plant_ask_health(historian->plant,
			                                         shown->drive->name, since_us,
			                                         (int)(left / DB_NS_PER_MS) + 1);
	}
	return told->answer;
}

static UA_StatusCode give_page(const struct db_opcua_history_page *page, const UA_DataType *type,
                               UA_TimestampsToReturn times, UA_HistoryReadResult *result,
                               UA_HistoryData *data)
{
	if (page->count == 0)
		return UA_STATUSCODE_GOODNODATA;
	data->dataValues = UA_Array_new(page->count, &UA_TYPES[UA_TYPES_DATAVALUE]);
	if (!data->dataValues)
		return UA_STATUSCODE_BADOUTOFMEMORY;
	data->dataValuesSize = page->count;
	for (size_t i = 0; i < page->count; i++) {
		const struct db_opcua_history_value *picked = &page->list[i];
		UA_DataValue *value = &data->dataValues[i];
		UA_Float real = (UA_Float)picked->number;
		UA_UInt32 whole = (UA_UInt32)picked->number;

		value->hasSourceTimestamp = times != UA_TIMESTAMPSTORETURN_SERVER;
		value->hasServerTimestamp = times != UA_TIMESTAMPSTORETURN_SOURCE;
		value->sourceTimestamp = UA_DATETIME_UNIX_EPOCH + picked->us * UA_DATETIME_USEC;
		value->serverTimestamp = value->sourceTimestamp;
		value->hasStatus = picked->missing;
		value->status = UA_STATUSCODE_BADBOUNDNOTFOUND;
		if (!picked->missing)
			value->hasValue = UA_Variant_setScalarCopy(
						  &value->value,
						  type == &UA_TYPES[UA_TYPES_FLOAT] ?
							  (const void *)&real :
							  (const void *)&whole,
						  type) == UA_STATUSCODE_GOOD;
	}
	if (page->after_us == 0)
		return UA_STATUSCODE_GOOD;
	if (UA_ByteString_allocBuffer(&result->continuationPoint, sizeof(page->after_us)) !=
	    UA_STATUSCODE_GOOD)
		return UA_STATUSCODE_BADOUTOFMEMORY;
	memcpy(result->continuationPoint.data, &page->after_us, sizeof(page->after_us));
	return UA_STATUSCODE_GOOD;
}

static UA_StatusCode read_node(const struct db_opcua_historian *historian, UA_Server *server,
                               const UA_ReadRawModifiedDetails *details,
                               UA_TimestampsToReturn times, const UA_HistoryReadValueId *wanted,
                               struct told *told, UA_HistoryReadResult *result,
                               UA_HistoryData *data)
{
	struct db_opcua_history_query query = { .start_us = db_opcua_us_of(details->startTime),
		                                .end_us = db_opcua_us_of(details->endTime),
		                                .most = details->numValuesPerNode,
		                                .bounds = details->returnBounds };
	struct db_opcua_subject subject;
	const struct db_opcua_register *reg = find_register(historian->roster, &wanted->nodeId,
	                                                    &subject);
	const UA_ByteString *after = &wanted->continuationPoint;
	struct db_opcua_history_page *page;
	const json_t *answer;
	UA_NodeClass class;
	UA_StatusCode status;

	if (!reg && UA_Server_readNodeClass(server, wanted->nodeId, &class) != UA_STATUSCODE_GOOD)
		return UA_STATUSCODE_BADNODEIDUNKNOWN;
	if (!reg)
		return UA_STATUSCODE_BADHISTORYOPERATIONUNSUPPORTED;
	if (wanted->indexRange.length > 0)
		return UA_STATUSCODE_BADINDEXRANGENODATA;
	if (!db_opcua_history_is_valid(&query))
		return UA_STATUSCODE_BADHISTORYOPERATIONINVALID;
	if (after->length != 0 && after->length != sizeof(query.after_us))
		return UA_STATUSCODE_BADCONTINUATIONPOINTINVALID;
	if (after->length != 0)
		memcpy(&query.after_us, after->data, sizeof(query.after_us));
	answer = ask(historian, told, subject.shown, db_opcua_history_since(&query));
	if (!answer)
		return UA_STATUSCODE_BADRESOURCEUNAVAILABLE;
	page = malloc(sizeof(*page));
	if (!page)
		return UA_STATUSCODE_BADOUTOFMEMORY;
	db_opcua_history_pick(&query, json_object_get(answer, "values"),
	                      db_opcua_history_field(reg->name), page);
	status = give_page(page, db_opcua_data_type(reg), times, result, data);
	free(page);
	return status;
}

static void refuse_all(UA_HistoryReadResponse *response)
{
	UA_Array_delete(response->results, response->resultsSize,
	                &UA_TYPES[UA_TYPES_HISTORYREADRESULT]);
	response->results = NULL;
	response->resultsSize = 0;
	response->responseHeader.serviceResult = UA_STATUSCODE_BADTOOMANYOPERATIONS;
}

static void read_raw(UA_Server *server, void *context, const UA_NodeId *session,
                     void *session_context, const UA_RequestHeader *header,
                     const UA_ReadRawModifiedDetails *details, UA_TimestampsToReturn times,
                     UA_Boolean release, size_t count, const UA_HistoryReadValueId *wanted,
                     UA_HistoryReadResponse *response, UA_HistoryData *const *const data)
{
	const struct db_opcua_historian *historian = context;
	struct told told = { .until = db_client_now() + WAIT_MAX_MS * DB_NS_PER_MS };

	(void)session;
	(void)session_context;
	(void)header;
	/* A continuation point has all there is to know: nothing is kept for it. */
	if (release)
		return;
	if (count > NODES_MAX) {
		refuse_all(response);
		return;
	}
	for (size_t i = 0; i < count; i++)
		response->results[i].statusCode = read_node(historian, server, details, times,
		                                            &wanted[i], &told,
		                                            &response->results[i], data[i]);
	json_decref(told.answer);
}

/* One node each time: a search of the trail takes longer than a request may wait. */
static void read_events(UA_Server *server, void *context, const UA_NodeId *session,
                        void *session_context, const UA_RequestHeader *header,
                        const UA_ReadEventDetails *details, UA_TimestampsToReturn times,
                        UA_Boolean release, size_t count, const UA_HistoryReadValueId *wanted,
                        UA_HistoryReadResponse *response, UA_HistoryEvent *const *const data)
{
	const struct db_opcua_historian *historian = context;
	UA_NodeClass class;

	(void)session_context;
	(void)header;
	(void)times;
	if (release)
		return;
	if (count > 1)
		refuse_all(response);
	else if (UA_Server_readNodeClass(server, wanted->nodeId, &class) != UA_STATUSCODE_GOOD)
		response->results[0].statusCode = UA_STATUSCODE_BADNODEIDUNKNOWN;
	else
		response->results[0].statusCode = db_opcua_past_read(
			historian->past, session, details, wanted,
			db_client_now() + WAIT_MAX_MS * DB_NS_PER_MS, &response->results[0],
			data[0]);
}

UA_HistoryDatabase db_opcua_historian_give(struct db_opcua_historian *historian)
{
	return (UA_HistoryDatabase){ .context = historian,
		                     .readRaw = read_raw,
		                     .readEvent = read_events };
}
