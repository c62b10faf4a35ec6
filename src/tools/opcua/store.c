/* SPDX-License-Identifier: Apache-2.0 */
#include "opcua/store.h"

#include "client/log.h"

#include <open62541/plugin/nodestore_default.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>

/* Most nodes held at the same time. The library holds as many as its path through the tree is long,
 * and a few more. */
#define HELD_MAX 32

/* The library's table of hints is not in order: for a value it asks for the data type, for a
 * description for the mask of what may be written (seen in 1.4.11). */
#define VALUE_HINTS (UA_NODEATTRIBUTESMASK_VALUE | UA_NODEATTRIBUTESMASK_DATATYPE)
#define DESCRIPTION_HINTS (UA_NODEATTRIBUTESMASK_DESCRIPTION | UA_NODEATTRIBUTESMASK_WRITEMASK)

struct db_opcua_store {
	const struct db_opcua_store_ops *ops;
	void *context;
	UA_UInt16 space; /* 0: not begun */
	UA_UInt16 types; /* the other namespace */
	UA_Nodestore plain;
	struct db_opcua_node *unheld;
	struct db_opcua_node pool[HELD_MAX];
};

/* --- references ------------------------------------------------------------------------------- */

struct db_opcua_references {
	struct db_opcua_node *node; /* NULL: references are only counted */
	UA_ReferenceTypeSet wanted;
	UA_BrowseDirection direction;
	UA_Byte type; /* of the latest one */
	bool inverse; /* also of that */
	size_t kinds; /* references of one type and direction in a row */
	size_t count;
	size_t bytes; /* of their ids */
	UA_ReferenceTarget *targets;
	UA_NodeId *ids;
	UA_Byte *texts;
};

bool db_opcua_store_wants(const struct db_opcua_references *references, UA_Byte type, bool inverse)
{
	UA_BrowseDirection unwanted = inverse ? UA_BROWSEDIRECTION_FORWARD :
	                                        UA_BROWSEDIRECTION_INVERSE;

	return references->direction != unwanted &&
	       UA_ReferenceTypeSet_contains(&references->wanted, type);
}

void db_opcua_store_refer(struct db_opcua_references *references, UA_Byte type, bool inverse,
                          UA_NodeId target, UA_QualifiedName name)
{
	size_t length = target.identifierType == UA_NODEIDTYPE_STRING ?
	                        target.identifier.string.length :
	                        0;
	bool same = references->count > 0 && references->type == type &&
	            references->inverse == inverse;
	UA_ReferenceTarget *place;
	UA_NodeReferenceKind *kind;
	UA_NodeHead *head;

	if (!db_opcua_store_wants(references, type, inverse))
		return;
	if (references->node) {
		head = &references->node->node.head;
		place = &references->targets[references->count];
		if (length > 0) {
			memcpy(references->texts + references->bytes, target.identifier.string.data,
			       length);
			target.identifier.string.data = references->texts + references->bytes;
		}
		references->ids[references->count] = target;
		place->targetId = UA_NodePointer_fromNodeId(&references->ids[references->count]);
		place->targetNameHash = UA_QualifiedName_hash(&name);
		if (!same)
			head->references[head->referencesSize++] = (UA_NodeReferenceKind){
				.targets.array = place,
				.referenceTypeIndex = type,
				.isInverse = inverse,
			};
		kind = head->references + head->referencesSize - 1;
		kind->targetsSize++;
	}
	references->type = type;
	references->inverse = inverse;
	references->kinds += !same;
	references->count++;
	references->bytes += length;
}

static bool add_references(const struct db_opcua_store *store, struct db_opcua_node *node,
                           UA_ReferenceTypeSet wanted, UA_BrowseDirection direction)
{
	struct db_opcua_references references = { .wanted = wanted, .direction = direction };
	size_t size;

	/* Attribute reads need no references. */
	if (direction == UA_BROWSEDIRECTION_INVALID)
		return true;
	store->ops->refer(store->context, &node->subject, &references);
	if (references.count == 0)
		return true;
	size = references.kinds * sizeof(UA_NodeReferenceKind) +
	       references.count * (sizeof(UA_ReferenceTarget) + sizeof(UA_NodeId));
	node->references = malloc(size + references.bytes);
	if (!node->references)
		return false;
	references.node = node;
	node->node.head.references = node->references;
	references.targets = (void *)(node->node.head.references + references.kinds);
	references.ids = (void *)(references.targets + references.count);
	references.texts = (void *)(references.ids + references.count);
	references.count = 0;
	references.bytes = 0;
	references.kinds = 0;
	store->ops->refer(store->context, &node->subject, &references);
	return true;
}

UA_Byte db_opcua_store_reference_type(const struct db_opcua_store *store, UA_UInt32 type)
{
	UA_NodeId id = UA_NODEID_NUMERIC(0, type);
	const UA_Node *node = store->plain.getNode(
		store->plain.context, &id, UA_NODEATTRIBUTESMASK_ALL, UA_REFERENCETYPESET_NONE,
		UA_BROWSEDIRECTION_INVALID);
	UA_Byte index = 0;

	if (!node)
		return 0;
	if (node->head.nodeClass == UA_NODECLASS_REFERENCETYPE)
		index = node->referenceTypeNode.referenceTypeIndex;
	store->plain.releaseNode(store->plain.context, node);
	return index;
}

UA_StatusCode db_opcua_store_link(struct db_opcua_store *store, UA_NodeId from, UA_Byte type,
                                  UA_NodeId target, UA_QualifiedName name, bool comes)
{
	UA_ExpandedNodeId to = UA_EXPANDEDNODEID_NODEID(target);
	UA_Node *node;
	UA_StatusCode status = store->plain.getNodeCopy(store->plain.context, &from, &node);

	if (status != UA_STATUSCODE_GOOD)
		return status;
	status = comes ? UA_Node_addReference(node, type, true, &to, UA_QualifiedName_hash(&name)) :
	                 UA_Node_deleteReference(node, type, true, &to);
	if (status == UA_STATUSCODE_GOOD)
		return store->plain.replaceNode(store->plain.context, node);
	store->plain.deleteNode(store->plain.context, node);
	return status;
}

/* --- nodes ------------------------------------------------------------------------------------ */

bool db_opcua_store_is_written(const struct db_opcua_subject *subject)
{
	/* Each subject that the library knows is part of such a node. */
	uintptr_t node = (uintptr_t)subject - offsetof(struct db_opcua_node, subject);

	return ((const struct db_opcua_node *)node)->written;
}

static void forget_node(struct db_opcua_store *store, struct db_opcua_node *node)
{
	/* A subscription was added or removed while the node was held. */
	if (node->listeners && node->node.head.monitoredItems != node->listeners_before)
		*node->listeners = node->node.head.monitoredItems;
	free(node->references);
	free(node->value);
	db_opcua_texts_clear(&node->description);
	node->next = store->unheld;
	store->unheld = node;
}

/* --- callbacks of the library ----------------------------------------------------------------- */

static const UA_Node *get_node(void *context, const UA_NodeId *node_id, UA_UInt32 attributes,
                               UA_ReferenceTypeSet references, UA_BrowseDirection direction)
{
	struct db_opcua_store *store = context;
	struct db_opcua_node *node = store->unheld;
	UA_String id = node_id->identifier.string;
	struct db_opcua_subject subject;

	if (store->space == 0 ||
	    (node_id->namespaceIndex != store->space && node_id->namespaceIndex != store->types) ||
	    node_id->identifierType != UA_NODEIDTYPE_STRING || id.length >= DB_OPCUA_ID_MAX ||
	    !store->ops->find(store->context, node_id->namespaceIndex, id, &subject))
		return store->plain.getNode(store->plain.context, node_id, attributes, references,
		                            direction);
	if (!node) {
		db_client_log(DB_CLIENT_ERROR, "more nodes are held than there can be");
		return NULL;
	}
	store->unheld = node->next;
	*node = (struct db_opcua_node){ .subject = subject };
	/* It reads single attributes, and writes to nodes with all of them (seen in 1.4.11). */
	node->written = attributes == UA_NODEATTRIBUTESMASK_ALL;
	node->described = !node->written && (attributes & DESCRIPTION_HINTS) != 0;
	memcpy(node->id, id.data, id.length);
	node->node.head.nodeId = (UA_NodeId){
		.namespaceIndex = node_id->namespaceIndex,
		.identifierType = UA_NODEIDTYPE_STRING,
		.identifier.string = { .length = id.length, .data = (UA_Byte *)node->id },
	};
	node->node.head.context = &node->subject;
	node->node.head.constructed = true;
	store->ops->fill(store->context, node, (attributes & VALUE_HINTS) != 0);
	if (node->listeners) {
		node->node.head.monitoredItems = *node->listeners;
		node->listeners_before = *node->listeners;
	}
	if (!add_references(store, node, references, direction)) {
		forget_node(store, node);
		return NULL;
	}
	return &node->node;
}

static const UA_Node *get_node_from_pointer(void *context, UA_NodePointer pointer,
                                            UA_UInt32 attributes, UA_ReferenceTypeSet references,
                                            UA_BrowseDirection direction)
{
	UA_NodeId id;

	if (!UA_NodePointer_isLocal(pointer))
		return NULL;
	id = UA_NodePointer_toNodeId(pointer);
	return get_node(context, &id, attributes, references, direction);
}

static void release_node(void *context, const UA_Node *node)
{
	struct db_opcua_store *store = context;
	uintptr_t place = (uintptr_t)node;

	if (place >= (uintptr_t)store->pool && place < (uintptr_t)(store->pool + HELD_MAX))
		forget_node(store, &store->pool[(const struct db_opcua_node *)node - store->pool]);
	else
		store->plain.releaseNode(store->plain.context, node);
}

static UA_Node *new_node(void *context, UA_NodeClass class)
{
	struct db_opcua_store *store = context;

	return store->plain.newNode(store->plain.context, class);
}

static void delete_node(void *context, UA_Node *node)
{
	struct db_opcua_store *store = context;

	store->plain.deleteNode(store->plain.context, node);
}

static UA_StatusCode get_node_copy(void *context, const UA_NodeId *id, UA_Node **node)
{
	struct db_opcua_store *store = context;

	return store->plain.getNodeCopy(store->plain.context, id, node);
}

static UA_StatusCode insert_node(void *context, UA_Node *node, UA_NodeId *id)
{
	struct db_opcua_store *store = context;

	return store->plain.insertNode(store->plain.context, node, id);
}

static UA_StatusCode replace_node(void *context, UA_Node *node)
{
	struct db_opcua_store *store = context;

	return store->plain.replaceNode(store->plain.context, node);
}

static UA_StatusCode remove_node(void *context, const UA_NodeId *id)
{
	struct db_opcua_store *store = context;

	return store->plain.removeNode(store->plain.context, id);
}

static const UA_NodeId *get_reference_type(void *context, UA_Byte index)
{
	struct db_opcua_store *store = context;

	return store->plain.getReferenceTypeId(store->plain.context, index);
}

/* Only the permanent ones. */
static void visit_nodes(void *context, UA_NodestoreVisitor visitor, void *data)
{
	struct db_opcua_store *store = context;

	store->plain.iterate(store->plain.context, visitor, data);
}

static void clear_store(void *context)
{
	struct db_opcua_store *store = context;

	store->space = 0;
	if (store->plain.context)
		store->plain.clear(store->plain.context);
	store->plain.context = NULL;
}

/* --- its life --------------------------------------------------------------------------------- */

struct db_opcua_store *db_opcua_store_new(const struct db_opcua_store_ops *ops, void *context)
{
	struct db_opcua_store *store = calloc(1, sizeof(*store));

	if (!store)
		return NULL;
	store->ops = ops;
	store->context = context;
	for (size_t i = 0; i < HELD_MAX; i++) {
		store->pool[i].next = store->unheld;
		store->unheld = &store->pool[i];
	}
	if (UA_Nodestore_HashMap(&store->plain) != UA_STATUSCODE_GOOD) {
		free(store);
		return NULL;
	}
	return store;
}

void db_opcua_store_free(struct db_opcua_store *store)
{
	if (!store)
		return;
	clear_store(store);
	free(store);
}

UA_Nodestore db_opcua_store_give(struct db_opcua_store *store)
{
	return (UA_Nodestore){
		.context = store,
		.clear = clear_store,
		.newNode = new_node,
		.deleteNode = delete_node,
		.getNode = get_node,
		.getNodeFromPtr = get_node_from_pointer,
		.releaseNode = release_node,
		.getNodeCopy = get_node_copy,
		.insertNode = insert_node,
		.replaceNode = replace_node,
		.removeNode = remove_node,
		.getReferenceTypeId = get_reference_type,
		.iterate = visit_nodes,
	};
}

void db_opcua_store_begin(struct db_opcua_store *store, UA_UInt16 space, UA_UInt16 types)
{
	store->space = space;
	store->types = types;
}
