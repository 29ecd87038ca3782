import sys,json,glob,collections
from pathlib import Path
sys.path.insert(0,'/work/main/benchmarks/hidden_worlds')
from scoring.outcome import outcome, RIGHT, WRONG
import numpy as np
U=Path('/work/out/posterior/U'); rows=collections.defaultdict(lambda:[0]*5); cpu=[[],[]]
for f in sorted((U/'new3').glob('*.json')):
    d=json.loads(f.read_text()); t=json.loads((U/'today'/f.name).read_text()); truth=json.loads((U/'truth'/f.name).read_text())
    if d['status']=='crashed': print('crash',f.name); continue
    for e in d['effects']: e.setdefault('confidence',None)
    a,b=outcome(truth,t['verdict']),outcome(truth,d)
    r=rows[t['block']]; r[0]+=1; r[1]+=a in RIGHT; r[2]+=b in RIGHT; r[3]+=a in WRONG; r[4]+=b in WRONG
    cpu[0].append(t['seconds']); cpu[1].append(d['seconds'])
    if a!=b: print(f.name[:6],t['block'],t['name'],'|',a,'|',b)
tot=[0]*5
for k,v in sorted(rows.items()): print(k,v); tot=[x+y for x,y in zip(tot,v)]
print('all',tot,[ (round(float(np.median(c)),1),round(float(np.percentile(c,95)),1)) for c in cpu])
